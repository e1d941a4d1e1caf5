"""The change of an arm since its training, from a short motion with the tip seen.

Maximum a posteriori estimate through the differentiable model, by Gauss-Newton. Priors
are normal, with the scales on which arms change between days. The variance of the noise,
which contains the errors of the model itself, is that of the residuals; since these are
correlated in time, so many samples count as one as their correlation lasts.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from itertools import permutations
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
from s2c2a.models.session import DayChange, SessionC2S
from s2c2a.spaces import AXIS, POSITION
from s2c2a.training import TrainingData

TRANSLATION = 5e-3  # m; of a tracking that stays where it is, unless more is seen
ROTATION = np.deg2rad(3.0)  # of the same: 5 mm over a base plate of 0.1 m
CABLE = 1e-3  # m; homings and pretensions of servo arms differ by this much
GAIN = 0.1  # spread of the stiffness of silicone and foam between batches and days
ITERATIONS = 8
"""Of Gauss-Newton, and of the registration before; more change no digit that is shown."""
STILL = 1e-4 * np.eye(3)
"""Vectors [m] that do not turn, shorter than any motion that is seen."""
FITTED = 0.475
"""Share of a session that is fitted where another one is judged: half of it, with the
gap of `data.windows.PARTS` between them."""
GROUPS = {
    "frame": ("translation", "rotation"),
    "homing": ("offsets", "slack"),
    "stiffness": ("gains",),
}
"""Causes of a change, and the parts of a `DayChange` that they are."""


class DayPosterior(NamedTuple):
    """A change, and how well it is known.

    Attributes:
        change: its most probable value.
        covariance: of its numbers, in the order of its parts.
    """

    change: DayChange
    covariance: Float[np.ndarray, "numbers numbers"]

    def part(
        self, name: str, module: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of a part of the change, or those of a module, and their covariance."""
        values, as_change = ravel_pytree(self.change)
        places = getattr(as_change(jnp.arange(len(values), dtype=jnp.float32)), name)
        rows = np.asarray(places if module is None else places[module], int).ravel()
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
        posterior: of the change.
        before: mean error of the tip without it [m].
        after: the same with it, on stretches that it was not fitted to [m].
        explained: part of the error that each cause explains [m] (`GROUPS`).
    """

    posterior: DayPosterior
    before: float
    after: float
    explained: dict[str, float]


def fit_session(model: ForwardModel, data: TrainingData) -> SessionFit:
    """Estimate the change of an arm from a recording of its present day.

    Args:
        model: of another day.
        data: of the present day; ends that are not seen are NaN.

    Raises:
        RecordingError: the tip is hardly seen, or the sensed configurations are not
            finite.
    """
    fit = _Residuals(model, data)
    seen = fit.seen_tip
    order = np.cumsum(seen).reshape(seen.shape) / max(seen.sum(), 1)
    first = (order <= FITTED)[..., None]
    last = (order > 1.0 - FITTED)[..., None]
    if not (seen[first[..., 0]].any() and seen[last[..., 0]].any()):
        raise RecordingError(
            f"the tip was seen in {counted(seen.sum(), 'sample')} of this recording, "
            "too few to fit and to judge; turn on the tracking (--tracking), and move for 50 s"
        )
    none = DayChange.none(data.arm.module_count)
    before = fit.tip_error(none, first | last)
    crossed = [(fit.posterior(first), last), (fit.posterior(last), first)]
    after = [fit.tip_error(fitted.change, judged) for fitted, judged in crossed]
    posterior = fit.posterior(np.ones_like(first))
    explained = _explained(fit, posterior.change)
    return SessionFit(posterior, before, float(np.mean(after)), explained)


class _Residuals:
    """Residuals of a model on a recording, and their derivatives by the change.

    An end may show its position, its axis, or both.

    Attributes:
        seen_tip: samples that show the position of the tip.
    """

    def __init__(self, model: ForwardModel, data: TrainingData):
        self._sensed = jnp.asarray(data.sensed, jnp.float32)
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

        @eqx.filter_jit
        def predict(model: ForwardModel, numbers: Array, sensed: Array) -> Array:
            change = self._as_change(numbers)
            simulate = partial(along_episode, SessionC2S.of(model, change))
            return jax.vmap(simulate)(sensed)

        @eqx.filter_jit
        def slopes(model: ForwardModel, numbers: Array, sensed: Array) -> Array:
            return jax.jacfwd(lambda at: predict(model, at, sensed))(numbers)

        self._predict = partial(predict, model, sensed=self._sensed)
        self._slopes = partial(slopes, model, sensed=self._sensed)

    def posterior(self, fitted: Bool[np.ndarray, "episodes samples 1"]) -> DayPosterior:
        """The change that fits some samples, and its covariance."""
        numbers = np.zeros(len(self._scales))
        numbers[:6] = self._registered(fitted)
        for _ in range(ITERATIONS):
            # a tracking that was put up anew is anywhere: its prior grows with the move
            moved = np.sqrt(np.mean(numbers[:6].reshape(2, 3) ** 2, axis=1))
            scales = self._scales.copy()
            scales[:6] = np.maximum(scales[:6], np.repeat(moved, 3))
            at = jnp.asarray(numbers, jnp.float32)
            errors = self._states - np.asarray(self._predict(at))
            slopes = np.asarray(self._slopes(at)) * scales
            precision = np.eye(len(numbers))
            gradient = -numbers / scales
            for part, known in zip((POSITION, AXIS), self._known, strict=True):
                for module in range(known.shape[-1]):
                    seen = (known & fitted)[..., module]
                    error = errors[..., module, part][seen].astype(float)
                    slope = slopes[..., module, part, :][seen].astype(float)
                    weight = _weight(error)
                    precision += weight * np.einsum("tki,tkj->ij", slope, slope)
                    gradient += weight * np.einsum("tki,tk->i", slope, error)
            numbers += scales * np.linalg.solve(precision, gradient)
        covariance = np.linalg.inv(precision) * np.outer(scales, scales)
        change = self._as_change(jnp.asarray(numbers, jnp.float32))
        return DayPosterior(change, covariance)

    def _registered(self, fitted: Bool[np.ndarray, "episodes samples 1"]) -> np.ndarray:
        """Translation and rotation of the frame that bring most ends to those predicted."""
        expected = np.asarray(self._predict(jnp.zeros(len(self._scales))), float)
        is_seen = self._known[0] & fitted
        places = expected[is_seen][:, POSITION]
        seen = self._states[is_seen][:, POSITION]
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
        return np.concatenate([shift, turn.as_rotvec()])

    def tip_error(
        self, change: DayChange, judged: Bool[np.ndarray, "episodes samples 1"] | bool
    ) -> float:
        """Mean distance of the seen tip from the model's, after a change [m]."""
        predicted = np.asarray(self._predict(ravel_pytree(change)[0]))
        errors = (self._states - predicted)[..., -1, POSITION]
        seen = (self._known[0] & judged)[..., -1]
        return float(np.linalg.norm(errors[seen], axis=-1).mean())


def _scales(arm: ArmSpec) -> DayChange:
    """Standard deviations of the prior."""
    radii = jnp.asarray(ArmGeometry.of(arm).cable_radii, jnp.float32)
    return DayChange(
        jnp.full(3, TRANSLATION),
        jnp.full(3, ROTATION),
        jnp.repeat(CABLE / radii[:, None], 2, axis=1),
        CABLE / radii,
        jnp.full(len(radii), GAIN),
    )


def _weight(errors: Float[np.ndarray, "samples 3"]) -> float:
    """Weight of every sample: the inverse variance, over the time of correlation."""
    power = float((errors**2).sum())
    if not power > 0.0:
        return 0.0
    return errors.size / (power * samples_per_independent_one(errors))


def samples_per_independent_one(errors: Float[np.ndarray, "samples 3"]) -> float:
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


def _explained(fit: _Residuals, change: DayChange) -> dict[str, float]:
    """Reduction of the tip's error by each cause [m], mean over the orders of causes.

    Shapley values: they add up to the reduction by all causes.
    """
    errors: dict[frozenset[str], float] = {}
    none = DayChange.none(len(change.gains))

    def error(causes: Iterable[str]) -> float:
        chosen = frozenset(causes)
        if chosen not in errors:
            kept = [name for cause in chosen for name in GROUPS[cause]]
            parts = {name: getattr(change, name) for name in kept}
            errors[chosen] = fit.tip_error(replace(none, **parts), True)
        return errors[chosen]

    orders = list(permutations(GROUPS))
    gained = dict.fromkeys(GROUPS, 0.0)
    for order in orders:
        for count, cause in enumerate(order):
            gain = error(order[:count]) - error(order[: count + 1])
            gained[cause] += gain / len(orders)
    return gained
