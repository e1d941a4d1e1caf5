"""How it is learned what sensors say of an arm's bends: from a recording that holds both (`learned`)."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.errors import TrainingError
from s2c2a.estimation.learned_sensors import Errors, LearnedNumbers
from s2c2a.models.layers import Scaling
from s2c2a.training.fit import Batch, FitOptions, Progress, fit, quiet
from s2c2a.training.trained import Trained, full_ranges, known_error, percent_error

FIT = FitOptions(
    learning_rate=3e-3,
    batch_size=64,
    max_epochs=40,
    patience=40,
    epochs_per_call=10,
    decay=True,
)
# samples in a row; every fifth such stretch is held out
STRETCH = 50
HELD_OUT = 5
# of the same
PLAYS = np.array([0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05, 0.07, 0.1])
# s; in which what comes and goes has gone, and in which zeros are seen to wander
LAGS = 5.0, 25.0
UNHEARD = 1e9  # a spread with which nothing is believed
# of what a sensor's numbers range over, either way
MIN_SPREAD = 0.005
MIN_ZERO = 0.05
MIN_WANDER = 3e-3


class Heard(NamedTuple):
    """What a sensor said while the arm was bent so, one row for a sample.

    Attributes:
        bends: true ones [rad], shape (samples, n) with n = 2 modules.
        numbers: in the sensor's units, shape (samples, numbers); NaN where it said
            nothing.
        episode: of each sample, shape (samples,).
        moment: in its episode [samples], shape (samples,).
    """

    bends: Float[np.ndarray, "samples bends"]
    numbers: Float[np.ndarray, "samples numbers"]
    episode: np.ndarray
    moment: np.ndarray

    @classmethod
    def of(
        cls, bends: np.ndarray, said: np.ndarray, lengths: tuple[int, ...] | None = None
    ) -> "Heard":
        """From whole episodes, shapes (episodes, samples, ...); what is not known counts nothing."""
        episodes, samples = bends.shape[:2]
        episode, moment = (part.reshape(-1) for part in np.indices((episodes, samples)))
        flat, numbers = (
            part.reshape(episodes * samples, -1).astype(np.float32)
            for part in (bends, said)
        )
        within = moment < np.asarray(lengths or [samples] * episodes)[episode]
        known = (
            within & np.isfinite(flat).all(axis=-1) & np.isfinite(numbers).any(axis=-1)
        )
        return cls(flat[known], numbers[known], episode[known], moment[known])

    def batch(self, scaling: Scaling, chosen: np.ndarray) -> Batch:
        """Some of them, numbers in units."""
        units = scaling.forward(jnp.asarray(self.numbers[chosen]))
        return {
            "bends": jnp.asarray(self.bends[chosen]),
            "episode": jnp.asarray(self.episode[chosen]),
            "units": units,
        }


class Zeroed(eqx.Module):
    """What is learned, and by how much it was off in every episode: zeros are other ones whenever an arm is opened."""

    numbers: LearnedNumbers
    zeros: Float[Array, "episodes numbers"]

    def units(self, batch: Batch) -> Float[Array, "samples numbers"]:
        """What is said, in units."""
        return (
            jax.vmap(self.numbers.network)(batch["bends"])
            + self.zeros[batch["episode"]]
        )


def learn_numbers(
    arm: ArmSpec, heard: Heard, key: PRNGKeyArray, progress: Progress = quiet
) -> Trained[LearnedNumbers]:
    """Learn what a sensor says of bends, and how far it is off that.

    Args:
        arm: whose sensor it is.
        heard: samples of a recording.
        key: of everything random.
        progress: told epoch, most epochs, validation loss.

    Raises:
        TrainingError: it said too little, or nothing that is finite.
    """
    held_out = heard.moment // STRETCH % HELD_OUT == HELD_OUT - 1
    if not (held_out.any() and (~held_out).sum() >= FIT.batch_size):
        raise TrainingError(
            f"a sensor said {len(heard.moment)} things in all, too few to learn from; collect more"
        )
    network_key, fit_key = jax.random.split(key)
    numbers = LearnedNumbers.untrained(arm, heard.numbers.shape[-1], network_key)
    usual = np.nan_to_num(_mean(heard.numbers))
    scaling = Scaling.of(np.where(np.isfinite(heard.numbers), heard.numbers, usual))
    begun = Zeroed(
        numbers, jnp.zeros((int(heard.episode.max()) + 1, heard.numbers.shape[-1]))
    )
    parts = heard.batch(scaling, ~held_out), heard.batch(scaling, held_out)
    fitted = fit(begun, _loss, *parts, FIT, fit_key, progress)
    learned, said = _with_errors(
        eqx.tree_at(lambda one: one.scaling, fitted.network.numbers, scaling),
        heard,
        arm,
    )
    percent = percent_error(
        said[held_out], heard.numbers[held_out], full_ranges(heard.numbers)
    )
    return Trained(learned, fitted.curve, percent)


_said = eqx.filter_jit(lambda learned, bends: jax.vmap(learned)(bends))


def _loss(model: Zeroed, batch: Batch, key: PRNGKeyArray | None) -> Array:
    return jnp.mean(known_error(model.units(batch), batch["units"]) ** 2)


def _with_errors(
    learned: LearnedNumbers, heard: Heard, arm: ArmSpec
) -> tuple[LearnedNumbers, np.ndarray]:
    """With what is left of a recording beside it, and all that was said as it is understood."""
    half = np.asarray(learned.scaling.half_range)
    followed = np.asarray(_said(learned, jnp.asarray(heard.bends)))
    play = fitted_play(heard, followed, half)
    lagging = played(heard, followed, play)
    zeros = _means(heard, heard.numbers - lagging)
    understood = lagging + zeros[heard.episode]
    usual = np.nan_to_num(_mean(zeros))
    errors = errors_of(
        heard, heard.numbers - understood, zeros - usual, play, half, arm.control_period
    )
    scaling = Scaling(
        learned.scaling.center + jnp.asarray(usual, jnp.float32),
        learned.scaling.half_range,
    )
    return LearnedNumbers(learned.network, scaling, errors), understood


def played(
    heard: Heard, followed: np.ndarray, widths: np.ndarray
) -> Float[np.ndarray, "samples numbers"]:
    """What follows with play of such half-widths, shape (numbers,); episodes begin where it stands amid of it."""
    lagging = followed.copy()
    goes_on = np.append(False, heard.episode[1:] == heard.episode[:-1])
    for now in np.flatnonzero(goes_on):
        lagging[now] = np.clip(
            lagging[now - 1], followed[now] - widths, followed[now] + widths
        )
    return lagging


def fitted_play(
    heard: Heard, followed: np.ndarray, half: np.ndarray
) -> Float[np.ndarray, " numbers"]:
    """Half-widths that leave least of what a sensor said, of each number."""
    tried = np.outer(PLAYS, half)
    left = [
        _spread(heard, heard.numbers - played(heard, followed, widths))
        for widths in tried
    ]
    return tried[np.argmin(left, axis=0), np.arange(len(half))]


def errors_of(
    heard: Heard,
    left: np.ndarray,
    zeros: np.ndarray,
    play: np.ndarray,
    half: np.ndarray,
    period: float,
) -> Errors:
    """What comes and goes, and what stays and wanders, of what is left beside what is learned.

    Args:
        heard: samples.
        left: what they were off by, but for zeros, shape (samples, numbers).
        zeros: of every episode, shape (episodes, numbers); NaN where it said nothing.
        play: in what was said, shape (numbers,).
        half: of what the numbers range over, shape (numbers,).
        period: between samples [s].
    """
    soon, later = (_changed(heard, left, max(1, round(lag / period))) for lag in LAGS)
    spread = np.sqrt(np.fmin(soon / 2.0, _spread(heard, left) ** 2))
    wander = np.sqrt(np.maximum(later - soon, 0.0) / (LAGS[1] - LAGS[0]))
    found = spread, np.sqrt(_mean(zeros**2)), wander, play
    least = MIN_SPREAD, MIN_ZERO, MIN_WANDER, 0.0
    errors = [np.fmax(one, low * half) for one, low in zip(found, least, strict=True)]
    errors[0] = np.where(_varies(heard.numbers), errors[0], UNHEARD)
    return Errors(*(jnp.asarray(one, jnp.float32) for one in errors))


def _varies(numbers: np.ndarray) -> np.ndarray:
    """Which numbers told something: that were said, and not always the same."""
    low = np.where(np.isfinite(numbers), numbers, np.inf)
    high = np.where(np.isfinite(numbers), numbers, -np.inf)
    return high.max(axis=0) > low.min(axis=0)


def _changed(heard: Heard, left: np.ndarray, lag: int) -> Float[np.ndarray, " numbers"]:
    """Mean square of the change after so many samples; NaN where no episode is as long."""
    together = (heard.episode[lag:] == heard.episode[:-lag]) & (
        heard.moment[lag:] - heard.moment[:-lag] == lag
    )
    return _mean((left[lag:] - left[:-lag])[together] ** 2)


def _spread(heard: Heard, left: np.ndarray) -> Float[np.ndarray, " numbers"]:
    """Root mean square beside the mean of each episode."""
    return np.sqrt(_mean((left - _means(heard, left)[heard.episode]) ** 2))


def _means(heard: Heard, left: np.ndarray) -> Float[np.ndarray, "episodes numbers"]:
    """Of every episode; NaN where nothing was said."""
    return np.stack(
        [
            _mean(left[heard.episode == one])
            for one in range(int(heard.episode.max()) + 1)
        ]
    )


def _mean(values: np.ndarray) -> Float[np.ndarray, " numbers"]:
    """Over samples that are known; NaN where none is."""
    known = np.isfinite(values)
    return np.where(known, values, 0.0).sum(axis=0) / np.where(
        known.any(axis=0), known.sum(axis=0), np.nan
    )
