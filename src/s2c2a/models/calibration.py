"""Calibration of a forward model's standard deviation on data that it has not seen.

A second, shorter training does not see the slowest and the fastest motion, the largest
bends and one region of the configurations. Its errors there, and on the validation
samples beside its training data, determine how the standard deviation grows with the
speed and with the distance from the data (`Uncertainty`). Cross-validation with random
samples would not show this: their neighbors in time are in the training data.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from s2c2a.kinematics import bends_from_configurations
from s2c2a.models.uncertainty import Uncertainty
from s2c2a.training.trained import TrainingData

INSIDE = "validation samples"
SLOWER = "slower motion"
FASTER = "faster motion"
LARGER = "larger bends"
REGION = "unseen region"
SHARE = 0.08  # of the samples in each group
PIECE_TIME = 5.0  # s; the speed is a mean over this time
MIN_PIECE = 10  # samples
MIN_GROUP = 30  # samples; smaller groups do not count
COVERED = 0.95  # share of the errors of each group within twice the standard deviation
MAX_FACTOR = 2.0  # by which the standard deviation is increased for that share
MIN_EXTRAPOLATION = 0.3  # least extrapolation error, over that before the calibration

Mask = Bool[np.ndarray, "episodes samples"]


@dataclass(frozen=True, eq=False)  # holds arrays
class GroupErrors:
    """Errors of a model on a group of samples.

    Attributes:
        distances: of true from predicted module ends [m], shape (samples, modules);
            NaN: unknown.
        speeds: of the sensed bends (`bend_speeds`) [rad per control step], shape
            (samples,).
        extrapolation: of the model, from zero near its data to one, shape (samples,).
    """

    distances: Float[np.ndarray, "samples modules"]
    speeds: Float[np.ndarray, " samples"]
    extrapolation: Float[np.ndarray, " samples"]

    @property
    def is_large_enough(self) -> bool:
        """Whether the tip's error is known in at least `MIN_GROUP` samples."""
        return int(np.isfinite(self.distances[:, -1]).sum()) >= MIN_GROUP

    @property
    def tip_error(self) -> float:
        """Mean error of the tip [m]."""
        return float(np.nanmean(self.distances[:, -1]))


def held_out_groups(data: TrainingData) -> dict[str, Mask]:
    """Samples to hide from the second training, by the name of their group."""
    bends = np.asarray(bends_from_configurations(jnp.asarray(data.sensed)))
    usable = _usable(data)
    speeds = _mean_over_pieces(bend_speeds(bends), usable, _piece_length(data))
    flat = bends.reshape(*bends.shape[:2], -1)
    size = np.linalg.norm(flat, axis=-1)
    rows = np.argwhere(usable)
    center = tuple(rows[np.random.default_rng(0).integers(len(rows))])
    distance = np.linalg.norm(flat - flat[center], axis=-1)
    return {
        SLOWER: _least(speeds, usable),
        FASTER: _least(-speeds, usable),
        LARGER: _least(-size, usable),
        REGION: _least(distance, usable),
    }


def bend_speeds(
    bends: Float[np.ndarray, "episodes samples modules 2"],
) -> Float[np.ndarray, "episodes samples"]:
    """Root mean square over modules of the change of bends [rad per control step].

    The speed at the first sample of an episode is zero.
    """
    changes = np.diff(bends, axis=1, prepend=bends[:, :1])
    return np.sqrt(np.mean(np.sum(changes**2, axis=-1), axis=-1))


def union(groups: Mapping[str, Mask]) -> Mask:
    """Samples of any group."""
    return np.any(list(groups.values()), axis=0)


def calibrated(
    uncertainty: Uncertainty, seen: Uncertainty, errors: Mapping[str, GroupErrors]
) -> Uncertainty:
    """The uncertainty of a model, from the errors of another one with less data.

    Nonnegative least squares fits the squared errors of every module by a constant, the
    squared speed and the squared extrapolation; every group has the same weight. A
    common factor, at most `MAX_FACTOR`, then covers `COVERED` of the tip's errors of
    each group. More data reduce all errors by the ratio of the errors on validation
    samples.

    Args:
        uncertainty: of the model.
        seen: of the one with less data.
        errors: of that one, by group; `INSIDE` is one of them.

    Returns:
        The uncertainty with other errors; unchanged if `INSIDE` is too small.
    """
    if not errors[INSIDE].is_large_enough:
        return uncertainty
    groups = [group for group in errors.values() if group.is_large_enough]
    modules = errors[INSIDE].distances.shape[1]
    fitted = [_fit_variances(groups, module) for module in range(modules)]
    constant, speed, extrapolation = np.sqrt(np.array(fitted).T)
    floor = np.asarray(uncertainty.extrapolation_error) * MIN_EXTRAPOLATION
    extrapolation = np.maximum(extrapolation, floor)
    probe = seen.with_errors(constant, speed, extrapolation)
    factor = _gain(uncertainty, seen) * _coverage_factor(probe, groups)
    return uncertainty.with_errors(
        factor * constant, factor * speed, factor * extrapolation
    )


def _gain(uncertainty: Uncertainty, seen: Uncertainty) -> Float[np.ndarray, " modules"]:
    """Ratio of the errors with all and with less data, at most one; one if unknown."""
    ratios = np.asarray(uncertainty.interpolation_error / seen.interpolation_error)
    return np.minimum(np.nan_to_num(ratios, nan=1.0), 1.0)


def _coverage_factor(probe: Uncertainty, groups: list[GroupErrors]) -> float:
    """Factor with which twice the tip's deviation covers most errors of each group."""
    factors = [1.0]
    for group in groups:
        extrapolation = jnp.asarray(group.extrapolation)
        std = probe.std(extrapolation, jnp.asarray(group.speeds))
        ratios = group.distances[:, -1] / (2.0 * np.asarray(std)[:, -1])
        factors.append(float(np.nanquantile(ratios, COVERED)))
    return min(max(factors), MAX_FACTOR)


def _fit_variances(groups: list[GroupErrors], module: int) -> Float[np.ndarray, "3"]:
    """Variance of a module's end: constant, per squared speed and extrapolation.

    Zero for a module whose end is never measured.
    """
    from scipy.optimize import nnls  # noqa: PLC0415  # heavy

    columns = []
    targets = []
    for group in groups:
        squares = group.distances[:, module] ** 2
        known = np.isfinite(squares)
        if not known.any():
            continue
        weight = 1.0 / np.sqrt(known.sum())
        terms = [np.ones(len(squares)), group.speeds**2, group.extrapolation**2]
        columns.append(weight * np.stack(terms, axis=-1)[known])
        targets.append(weight * squares[known])
    if not columns:
        return np.zeros(3)
    matrix = np.concatenate(columns)
    # columns of comparable size
    scales = np.maximum(np.linalg.norm(matrix, axis=0), 1e-12)
    solution, _residual = nnls(matrix / scales, np.concatenate(targets))
    return solution / scales


def _usable(data: TrainingData) -> Mask:
    """Samples with a known state, without padding."""
    known = np.isfinite(data.states).any(axis=(2, 3))
    for row, length in zip(known, data.lengths or (), strict=False):
        row[length:] = False
    return known


def _piece_length(data: TrainingData) -> int:
    """Number of samples over which speeds are averaged."""
    return max(MIN_PIECE, round(PIECE_TIME * data.arm.control_rate))


def _mean_over_pieces(
    values: Float[np.ndarray, "episodes samples"], usable: Mask, length: int
) -> Float[np.ndarray, "episodes samples"]:
    """Mean of the usable values in each piece of an episode, at every sample of it."""
    means = np.zeros_like(values)
    for begin in range(0, values.shape[1], length):
        piece = slice(begin, begin + length)
        counts = usable[:, piece].sum(axis=1, keepdims=True)
        sums = values[:, piece].sum(axis=1, keepdims=True, where=usable[:, piece])
        means[:, piece] = sums / np.maximum(counts, 1)
    return means


def _least(values: Float[np.ndarray, "episodes samples"], usable: Mask) -> Mask:
    """The share of the usable samples with the least values; of equal ones, the first."""
    candidates = np.flatnonzero(usable)
    order = np.argsort(values.ravel()[candidates], kind="stable")
    chosen = np.zeros(usable.size, bool)
    chosen[candidates[order[: round(SHARE * len(order))]]] = True
    return chosen.reshape(usable.shape)
