"""Training of learned sensor models, from a recording with true states."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.arm.backlash import play
from s2c2a.errors import TrainingError, counted
from s2c2a.estimation.sensor_models.learned import SensorErrors, SensorNetwork
from s2c2a.files.text import LARGEST
from s2c2a.models.layers import Scaling
from s2c2a.training.fit import Batch, FitOptions, TrainingProgress, fit, quiet
from s2c2a.training.trained import Trained, full_ranges, known_error, percent_error

# shorter than the training of networks of motion: the errors of sensors are static
FIT = FitOptions(
    learning_rate=3e-3,
    batch_size=64,
    max_epochs=40,
    patience=40,
    epochs_per_call=10,
    decay=True,
)
BLOCK = 50  # samples in a row, of which every fifth block is held out
BLOCKS_PER_TEST = 5  # a fifth of the samples
# half-widths of the hysteresis to compare, in parts of the half range of the values
BACKLASHES = np.array(
    [0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05, 0.07, 0.1]
)
SHORT_LAG = 5.0  # s; after it, short-term errors are independent
LONG_LAG = 25.0  # s; over which drift is measured: half of a recorded episode of 50 s
# smallest errors, since a short recording may show none; in parts of the half range of the values
MIN_NOISE = 0.005
MIN_BIAS = 0.05
MIN_DRIFT = 3e-3

SampleValues = Float[np.ndarray, "samples values"]
PerValue = Float[np.ndarray, " values"]
Chosen = Bool[np.ndarray, " samples"]
Numbering = Int[np.ndarray, " samples"]


class SensorSamples(NamedTuple):
    """Measurements of a sensor with the true bends, one row a sample.

    Attributes:
        bends: true bends [rad], shape (samples, n) with n = 2 modules.
        values: in the sensor's unit, shape (samples, values); NaN where missing.
        episode: of each sample, shape (samples,).
        step: within its episode, shape (samples,).
    """

    bends: Float[np.ndarray, "samples bends"]
    values: SampleValues
    episode: Numbering
    step: Numbering

    @classmethod
    def of(
        cls,
        bends: Float[np.ndarray, "episodes steps modules 2"],
        values: Float[np.ndarray, "episodes steps *shape"],
        lengths: tuple[int, ...] | None = None,
    ) -> "SensorSamples":
        """All usable samples of whole episodes.

        Args:
            bends: true bends [rad].
            values: of the sensor.
            lengths: of the episodes; whole if None.
        """
        episodes, steps = bends.shape[:2]
        episode, step = np.indices((episodes, steps)).reshape(2, -1)
        flat_bends = bends.reshape(episodes * steps, -1).astype(np.float32)
        flat_values = values.reshape(episodes * steps, -1).astype(np.float32)
        ends = np.asarray(lengths or [steps] * episodes)
        usable = step < ends[episode]
        usable &= np.isfinite(flat_bends).all(axis=-1)
        usable &= np.isfinite(flat_values).any(axis=-1)
        return cls(
            flat_bends[usable], flat_values[usable], episode[usable], step[usable]
        )

    def batch(self, scaling: Scaling, chosen: Chosen) -> Batch:
        """Some of the samples, with scaled values."""
        return {
            "bends": jnp.asarray(self.bends[chosen]),
            "episode": jnp.asarray(self.episode[chosen]),
            "scaled": scaling.forward(jnp.asarray(self.values[chosen])),
        }


class BiasedNetwork(eqx.Module):
    """A network with a bias per episode: biases differ whenever the arm is opened."""

    network: SensorNetwork
    biases: Float[Array, "episodes values"]

    def scaled(self, batch: Batch) -> Float[Array, "samples values"]:
        """Predicted values, scaled."""
        predicted = jax.vmap(self.network.network)(batch["bends"])
        return predicted + self.biases[batch["episode"]]


def train_sensor(
    arm: ArmSpec,
    samples: SensorSamples,
    key: PRNGKeyArray,
    progress: TrainingProgress = quiet,
) -> Trained[SensorNetwork]:
    """Train the network of a sensor and measure its errors.

    Args:
        arm: that the sensor belongs to.
        samples: of a recording.
        key: of everything random.
        progress: called with epoch, number of epochs, validation loss.

    Raises:
        TrainingError: too few samples.
    """
    held_out, seen = _held_out_and_seen(samples.step)
    if not held_out.any() or seen.sum() < FIT.batch_size:
        raise TrainingError(
            f"{counted(len(samples.step), 'sample')} of a sensor cannot be learned from; "
            "collect more"
        )
    network_key, fit_key = jax.random.split(key)
    values = samples.values.shape[-1]
    network = SensorNetwork.untrained(arm, values, network_key)
    mean = np.nan_to_num(_mean(samples.values))
    known = np.where(np.isfinite(samples.values), samples.values, mean)
    scaling = Scaling.of(known)
    biases = jnp.zeros((int(samples.episode.max()) + 1, values))
    fitted, curve = fit(
        BiasedNetwork(network, biases),
        _loss,
        samples.batch(scaling, seen),
        samples.batch(scaling, held_out),
        FIT,
        fit_key,
        progress,
    )
    network = eqx.tree_at(lambda network: network.scaling, fitted.network, scaling)
    network, predicted = _with_errors(network, samples, arm.control_period)
    percent = percent_error(
        predicted[held_out], samples.values[held_out], full_ranges(samples.values)
    )
    return Trained(network, curve, percent)


def _held_out_and_seen(step: Numbering) -> tuple[Chosen, Chosen]:
    """Samples that judge, and those that train, by their steps in an episode.

    Half a block on either side does neither: neighbors in time are alike.
    """

    def is_held_out(steps: Numbering) -> Chosen:
        return steps // BLOCK % BLOCKS_PER_TEST == BLOCKS_PER_TEST - 1

    gap = BLOCK // 2
    beside = is_held_out(step + gap) | is_held_out(np.maximum(step - gap, 0))
    held_out = is_held_out(step)
    return held_out, ~held_out & ~beside


def _loss(model: BiasedNetwork, batch: Batch, key: PRNGKeyArray | None) -> Array:
    return jnp.mean(known_error(model.scaled(batch), batch["scaled"]) ** 2)


@eqx.filter_jit
def _predict(
    network: SensorNetwork, bends: Float[Array, "samples bends"]
) -> Float[Array, "samples values"]:
    return jax.vmap(network)(bends)


def _with_errors(
    network: SensorNetwork, samples: SensorSamples, period: float
) -> tuple[SensorNetwork, SampleValues]:
    """The network with its hysteresis and errors, and its predictions with biases."""
    half_range = np.asarray(network.scaling.half_range)
    predicted = np.asarray(_predict(network, jnp.asarray(samples.bends)))
    # half-widths with the smallest residual, of every value
    candidates = np.outer(BACKLASHES, half_range)
    lags = (with_backlash(samples, predicted, each) for each in candidates)
    stds = [_std_within_episodes(samples, samples.values - each) for each in lags]
    backlash = candidates[np.argmin(stds, axis=0), np.arange(len(half_range))]
    lagging = with_backlash(samples, predicted, backlash)
    biases = _episode_means(samples, samples.values - lagging)
    explained = lagging + biases[samples.episode]
    mean_bias = np.nan_to_num(_mean(biases))
    # noise, bias and drift of what the network leaves unexplained
    residuals = samples.values - explained
    short = _change(samples, residuals, max(1, round(SHORT_LAG / period)))
    long = _change(samples, residuals, max(1, round(LONG_LAG / period)))
    variance = _std_within_episodes(samples, residuals) ** 2
    noise = np.sqrt(np.fmin(short / 2.0, variance))
    noise = np.fmax(noise, MIN_NOISE * half_range)
    initial_bias = np.sqrt(_mean((biases - mean_bias) ** 2))
    initial_bias = np.fmax(initial_bias, MIN_BIAS * half_range)
    drift = np.sqrt(np.maximum(long - short, 0.0) / (LONG_LAG - SHORT_LAG))
    drift = np.fmax(drift, MIN_DRIFT * half_range)
    # a value that never changes says nothing of its noise
    is_known = np.isfinite(samples.values)
    low = np.where(is_known, samples.values, np.inf).min(axis=0)
    high = np.where(is_known, samples.values, -np.inf).max(axis=0)
    noise = np.where(high > low, noise, LARGEST)
    stds_and_backlash = noise, initial_bias, drift, backlash
    errors = SensorErrors(
        *(jnp.asarray(each, jnp.float32) for each in stds_and_backlash)
    )
    center = network.scaling.center + jnp.asarray(mean_bias, jnp.float32)
    scaling = Scaling(center, network.scaling.half_range)
    return SensorNetwork(network.network, scaling, errors), explained


def with_backlash(
    samples: SensorSamples, predicted: SampleValues, half_widths: PerValue
) -> SampleValues:
    """Predictions behind a play operator; every episode starts in its middle."""
    lagging = predicted.copy()
    continues = np.append(False, samples.episode[1:] == samples.episode[:-1])
    low = predicted - half_widths
    high = predicted + half_widths
    for row in np.flatnonzero(continues):
        lagging[row] = play(lagging[row - 1], low[row], high[row])
    return lagging


def _change(samples: SensorSamples, residuals: np.ndarray, lag: int) -> PerValue:
    """Mean square of the change over a lag [samples]; NaN if no episode is as long."""
    same_episode = samples.episode[lag:] == samples.episode[:-lag]
    no_gap = samples.step[lag:] - samples.step[:-lag] == lag
    changes = residuals[lag:] - residuals[:-lag]
    return _mean(changes[same_episode & no_gap] ** 2)


def _std_within_episodes(samples: SensorSamples, residuals: np.ndarray) -> PerValue:
    """Standard deviation about the mean of each episode."""
    means = _episode_means(samples, residuals)[samples.episode]
    return np.sqrt(_mean((residuals - means) ** 2))


def _episode_means(
    samples: SensorSamples, values: np.ndarray
) -> Float[np.ndarray, "episodes values"]:
    """Mean of every episode; NaN where values are missing."""
    episodes = range(int(samples.episode.max()) + 1)
    return np.stack([_mean(values[samples.episode == number]) for number in episodes])


def _mean(values: np.ndarray) -> PerValue:
    """Mean of the known values; NaN where none is known."""
    is_known = np.isfinite(values)
    counts = is_known.sum(axis=0).astype(float)
    counts[counts == 0] = np.nan
    return np.where(is_known, values, 0.0).sum(axis=0) / counts
