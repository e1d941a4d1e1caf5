"""The change of an arm since its training, from a short motion with the tip seen.

Maximum a posteriori estimate through the differentiable model, by Gauss-Newton, from the
likelier of a frame and a homing that changed alone. Priors are normal, with the scales on
which arms change between days, or that of a change of frame or cables where it is larger:
they may be homed, or a tracking put up, anywhere, and modules stay what they are. Most of
the noise is errors of the model itself. They are common to all ends, and last: so many
samples count as one as their correlation lasts, and all ends together count as one. Their
variance is that on stretches that were not fitted, since a change can imitate a part of
them.
"""

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import RecordingError, counted
from s2c2a.models.forward_model import ForwardModel, along_episode
from s2c2a.models.local_training import is_smaller
from s2c2a.models.residual_process import GAP
from s2c2a.models.session import DayChange, SessionC2S
from s2c2a.models.trunk import Trunk
from s2c2a.spaces import AXIS, POSITION
from s2c2a.training import TrainingData

ChangeNumbers = Float[np.ndarray, " numbers"]
Chosen = Bool[np.ndarray, "episodes samples"]
Errors = Float[np.ndarray, "samples 3"]
Points = Float[np.ndarray, "points 3"]
Vector = Float[np.ndarray, "3"]
TRANSLATION = 5e-3  # m; of a tracking that stays where it is, unless more is seen
ROTATION = np.deg2rad(3.0)  # of the same: 5 mm over a base plate of 0.1 m
CABLE = 1e-3  # m; homings and pretensions of servo arms differ by this much
SOFTNESS = 0.2
"""Of silicone and foam between days, where 0.1 halves a true change of 15 %. Also error of
models, relative to the change: training hardly shows how stiff cables are."""
ITERATIONS = 8
"""Of Gauss-Newton, and of the registration before; more change no digit that is shown."""
STILL = 1e-4 * np.eye(3)
"""Vectors [m] that do not turn, shorter than any motion that is seen."""
FOLDS = 4
"""Parts of a session, each judged by a fit of the others; with 8, judgments are the same."""
FEWEST = FOLDS * GAP
"""Samples with the tip seen, to fit and to judge."""
APART = 0.05  # of a session, fitted to judged: 2.5 s, as long as errors last


class DayPosterior(NamedTuple):
    """A change, and how well it is known.

    Attributes:
        change: its most probable value.
        covariance: of its numbers, in the order of its parts.
    """

    change: DayChange
    covariance: Float[np.ndarray, "numbers numbers"]

    def part(
        self, *names: str, module: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of parts of the change, or those of a module, and their covariance."""
        values, as_change = ravel_pytree(self.change)
        places = as_change(jnp.arange(len(values), dtype=jnp.float32))
        parts = [np.asarray(getattr(places, name), int) for name in names]
        if module is not None:
            parts = [part[module] for part in parts]
        rows = np.concatenate([part.ravel() for part in parts])
        return np.asarray(values, float)[rows], self.covariance[np.ix_(rows, rows)]

    @property
    def std(self) -> DayChange:
        """Standard deviation of every number of the change."""
        as_change = ravel_pytree(self.change)[1]
        std = np.sqrt(np.diag(self.covariance))
        return as_change(jnp.asarray(std, jnp.float32))


class SessionFit(NamedTuple):
    """What a session shows.

    Attributes:
        posterior: of the change that it shows.
        change: the best one; the earlier one where that improves, and the new one does
            not, or has the larger mean error.
        before: mean error of the tip without a change [m].
        after: the same with the best one, on stretches that it was not fitted to [m].
        improves: whether it surely lowers the squared error there, also below that of
            a tip that is always in the middle of where it was seen.
    """

    posterior: DayPosterior
    change: DayChange
    before: float
    after: float
    improves: bool


def fit_session(
    model: ForwardModel, data: TrainingData, earlier: DayChange | None = None
) -> SessionFit:
    """Estimate the change of an arm from a recording of its present day.

    Args:
        model: of another day.
        data: of the present day; ends that are not seen are NaN.
        earlier: a change that another recording showed.

    Raises:
        RecordingError: the tip is hardly seen, or the sensed configurations are not
            finite.
    """
    fit = _Residuals(model, data)
    seen = fit.seen_tip
    if seen.sum() < FEWEST:
        raise RecordingError(
            f"the tip was seen in {counted(seen.sum(), 'sample')} of this recording, and "
            f"at least {FEWEST} are needed to fit and to judge; turn on the tracking "
            "(--tracking), and move for 50 s"
        )
    nothing = DayChange.none(data.arm.module_count)
    without = np.linalg.norm(fit.tip_errors(nothing), axis=-1)
    tip = data.states[seen][:, -1, POSITION]
    motion = np.linalg.norm(tip - tip.mean(axis=0), axis=-1)
    _, inflation, _ = _judged(fit, 1.0)
    errors, _, duration = _judged(fit, inflation)

    def is_better(found: np.ndarray) -> bool:
        shown = found[seen]
        return is_smaller(shown, without[seen], 2.0) and is_smaller(shown, motion, 2.0)

    posterior = fit.posterior(np.ones_like(seen), inflation, duration)
    change = posterior.change
    improves = is_better(errors)
    if earlier is not None:
        kept = np.linalg.norm(fit.tip_errors(earlier), axis=-1)
        is_worse = improves and np.nanmean(errors) < np.nanmean(kept)
        if is_better(kept) and not is_worse:
            change, errors, improves = earlier, kept, True
    return SessionFit(
        posterior,
        change,
        before=float(np.nanmean(without)),
        after=float(np.nanmean(errors)),
        improves=improves,
    )


def _judged(
    fit: "_Residuals", inflation: float
) -> tuple[Float[np.ndarray, "episodes samples"], float, float]:
    """Errors of the tip where it was not fitted [m], beside those where it was.

    Args:
        fit: residuals of all samples.
        inflation: see `_Residuals.posterior`.

    Returns:
        Distances; their mean square over that where the tip was fitted; and the same of
        the time for which errors last.
    """
    seen = fit.seen_tip
    order = np.cumsum(seen).reshape(seen.shape) / seen.sum()
    errors = np.full((*seen.shape, 3), np.nan)
    squares, times = [], []
    for middle in (np.arange(FOLDS) + 0.5) / FOLDS:
        away = np.abs(order - middle) - 0.5 / FOLDS
        found = fit.tip_errors(fit.posterior(away > APART, inflation).change)
        errors[away <= 0.0] = found[away <= 0.0]
        fitted = found[seen & (away > APART)]
        squares.append(np.mean(fitted**2))
        times.append(samples_per_independent_one(fitted))
    unseen = errors[seen]
    return (
        np.linalg.norm(errors, axis=-1),
        float(np.mean(unseen**2) / np.mean(squares)),
        max(1.0, samples_per_independent_one(unseen) / float(np.mean(times))),
    )


class _Residuals:
    """Residuals of a model on a recording, and their derivatives by the change.

    An end may show its position, its axis, or both.

    Attributes:
        seen_tip: samples that show the position of the tip.
    """

    def __init__(self, model: ForwardModel, data: TrainingData):
        sensed = jnp.asarray(data.sensed, jnp.float32)
        self._states = np.array(data.states, np.float32)
        for episode, length in enumerate(data.lengths or ()):
            self._states[episode, length:] = np.nan
        known = np.isfinite(self._states)
        self._known: list[Any] = [known[..., part].all(-1) for part in (POSITION, AXIS)]
        self.seen_tip = self._known[0][..., -1]
        is_used = np.any(self._known, axis=(0, -1))
        if not np.isfinite(data.sensed[is_used]).all():
            raise RecordingError("sensed configurations are missing in this recording")
        flat, self._as_change = ravel_pytree(_scales(data.arm))
        self._scales = np.asarray(flat)
        beyond = beyond_bends(data)
        self._predict = partial(_predict, model=model, sensed=sensed, beyond=beyond)
        self._slopes = partial(_slopes, model=model, sensed=sensed, beyond=beyond)
        self._start = self._likeliest()

    def posterior(
        self, fitted: Chosen, inflation: float, duration: float = 1.0
    ) -> DayPosterior:
        """The change that fits some samples, and its covariance.

        Args:
            fitted: the samples.
            inflation: variance of the noise over that of the residuals.
            duration: of errors over that of the residuals; the covariance counts it.
        """
        numbers, scales, precision = self._nearest(self._start, fitted, inflation)
        # of an estimate whose samples tell less than it takes them for
        prior = np.eye(len(numbers))
        noise = prior + duration * (precision - prior)
        covariance = np.linalg.solve(precision, noise) @ np.linalg.inv(precision)
        covariance *= np.outer(scales, scales)
        change = self._as_change(jnp.asarray(numbers, jnp.float32))
        # a wrong effect of softness shows as slack, too
        nothing = DayChange.none(len(change.slack))
        wrong = replace(nothing, slack=change.softness, softness=change.softness)
        of_model = SOFTNESS * np.asarray(ravel_pytree(wrong)[0])
        return DayPosterior(change, covariance + np.diag(of_model**2))

    def _likeliest(self) -> ChangeNumbers:
        """Numbers to start from: of a frame or a homing that first changes alone."""
        seen = self._known[0]
        nothing = np.zeros_like(self._scales)
        expected = np.asarray(self._predict(jnp.asarray(nothing)), float)
        moved = register(expected[seen, POSITION], self._states[seen, POSITION])
        modules = seen.shape[-1]
        turned = replace(DayChange.none(modules), offsets=jnp.ones((modules, 2)))
        # bends by up to 1 rad and nothing else
        homing = np.maximum(ravel_pytree(turned)[0], np.finfo(float).tiny)
        everything = np.ones_like(self.seen_tip)
        homed, *_ = self._nearest(nothing, everything, 1.0, homing)
        starts = np.concatenate([*moved, nothing[6:]]), homed
        fits = [self._nearest(start, everything, 1.0)[0] for start in starts]
        return min(fits, key=self._surprise)

    def _surprise(self, numbers: ChangeNumbers) -> float:
        """Negative log probability by positions of the tip, without constants.

        Axes can be fitted at the cost of positions, and errors that last longer count for
        fewer samples.
        """
        scales = self._grown(numbers)
        change = self._as_change(jnp.asarray(numbers, jnp.float32))
        errors = self.tip_errors(change)[self.seen_tip]
        size = np.linalg.norm(errors) or np.finfo(float).tiny
        prior = np.log(scales).sum() + np.sum((numbers / scales) ** 2) / 2.0
        return float(prior + errors.size / GAP * np.log(size))

    def _nearest(
        self,
        numbers: ChangeNumbers,
        fitted: Chosen,
        inflation: float,
        prior: ChangeNumbers | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The optimum that is nearest to a start.

        Args:
            numbers: of the change, to start from.
            fitted: see `posterior`.
            inflation: see `posterior`.
            prior: scales that stay; by default those of days, or the change's own.

        Returns:
            Its numbers, scales of their prior, and the precision in these scales.
        """
        measured = [
            (module, part, seen)
            for part, known in zip((POSITION, AXIS), self._known, strict=True)
            for module, seen in enumerate(np.moveaxis(known & fitted[..., None], -1, 0))
            if seen.any()
        ]
        for _ in range(ITERATIONS):
            scales = self._grown(numbers) if prior is None else prior
            at = jnp.asarray(numbers, jnp.float32)
            errors = self._states - np.asarray(self._predict(at))
            slopes = np.asarray(self._slopes(at)) * scales
            precision = np.eye(len(numbers))
            gradient = -numbers / scales
            for module, part, seen in measured:
                error = errors[..., module, part][seen].astype(float)
                slope = slopes[..., module, part, :][seen].astype(float)
                weight = _weight(error) / (inflation * len(measured))
                precision += weight * np.einsum("tki,tkj->ij", slope, slope)
                gradient += weight * np.einsum("tki,tk->i", slope, error)
            numbers = numbers + scales * np.linalg.solve(precision, gradient)
        return numbers, scales, precision

    def _grown(self, numbers: ChangeNumbers) -> np.ndarray:
        """Scales of days, or of the change of frame or cables, whichever are larger."""
        parts = self._as_change(numbers / self._scales)
        sizes = jax.tree.map(
            lambda part: jnp.full(part.shape, jnp.sqrt(jnp.mean(part**2))),
            replace(parts, softness=jnp.zeros_like(parts.softness)),
        )
        return self._scales * np.maximum(1.0, ravel_pytree(sizes)[0])

    def tip_errors(self, change: DayChange) -> Float[np.ndarray, "episodes samples 3"]:
        """Seen position of the tip less the model's after a change [m]; NaN: unseen."""
        predicted = np.asarray(self._predict(ravel_pytree(change)[0]))
        errors = (self._states - predicted)[..., -1, POSITION]
        return np.where(self.seen_tip[..., None], errors, np.nan)


def register(places: Points, seen: Points) -> tuple[Vector, Vector]:
    """Translation [m] and rotation vector [rad] that bring most places to where they are seen.

    Args:
        places: [m].
        seen: [m].
    """
    weights = np.ones(len(places))
    for _ in range(ITERATIONS):
        weights /= weights.sum()
        middles = weights @ places, weights @ seen
        # what a motion does not show does not turn
        turn, _ = Rotation.align_vectors(
            np.concatenate([seen - middles[1], STILL]),
            np.concatenate([places - middles[0], STILL]),
            np.concatenate([weights, np.ones(3)]),
        )
        shift = middles[1] - turn.apply(middles[0])
        errors = np.linalg.norm(seen - turn.apply(places) - shift, axis=-1)
        # as the least sum of distances, with the median in place of zeros
        weights = 1.0 / np.maximum(errors, max(float(np.median(errors)), 1e-9))
    return shift, turn.as_rotvec()


def beyond_bends(data: TrainingData) -> Float[Array, "episodes samples modules cables"]:
    """What cables move beyond the sensed bends, such as together, over their radius [rad]."""
    sensed = jnp.asarray(data.sensed, jnp.float32)
    if data.displacements is None:
        return jnp.zeros((*sensed.shape[:-1], 1))
    of_bends = Trunk.of(data.arm).displacements(sensed)
    return jnp.asarray(data.displacements, jnp.float32) - of_bends


@eqx.filter_jit
def _predict(
    numbers: Array,
    model: ForwardModel,
    sensed: Float[Array, "episodes samples modules 3"],
    beyond: Float[Array, "episodes samples modules _"],
) -> Float[Array, "episodes samples modules 6"]:
    """States of every sample after a change, given as its numbers."""
    as_change = ravel_pytree(DayChange.none(sensed.shape[-2]))[1]
    at = partial(SessionC2S.of, model, as_change(numbers), 0.0)
    return jax.vmap(partial(along_episode, at))(sensed, beyond)


_slopes = eqx.filter_jit(jax.jacfwd(_predict))


def _scales(arm: ArmSpec) -> DayChange:
    """Standard deviations of the prior."""
    radii = jnp.asarray(ArmGeometry.of(arm).cable_radii, jnp.float32)
    return DayChange(
        jnp.full(3, TRANSLATION),
        jnp.full(3, ROTATION),
        jnp.repeat(CABLE / radii[:, None], 2, axis=1),
        CABLE / radii,
        jnp.full(len(radii), SOFTNESS),
    )


def _weight(errors: Errors) -> float:
    """Weight of every sample: the inverse variance, over the time of correlation."""
    power = float((errors**2).sum())
    if not power > 0.0:
        return 0.0
    return errors.size / (power * samples_per_independent_one(errors))


def samples_per_independent_one(errors: Errors) -> float:
    """Number of successive samples that tell as much as one independent one.

    1 + 2 sum r_k, with the correlations r_k up to the first that is not positive.
    """
    power = float((errors**2).sum())
    time = 1.0
    for lag in range(1, len(errors)):
        product = float((errors[lag:] * errors[:-lag]).sum())
        if product <= 0.0:
            break
        time += 2.0 * product / power
    return time
