"""Outliers of measured module ends: frozen, jumped or swapped bodies, wrong lengths.

A pose, which is one end in one row, is compared with a robust regression on the drives
and with its neighbors in time: a true error grows and decays in several rows. Poses that
are only repeated are found before (`measurements.frozen_ends`), so that they calibrate nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from s2c2a.arm.tracking import MOUNTING, STRETCH
from s2c2a.errors import counted
from s2c2a.measurements.frozen_ends import MIN_ROWS, Drives, Points, find_frozen

PoseMask = Bool[np.ndarray, "rows ends"]
EndVectors = Float[np.ndarray, "rows ends 3"]
MAX_SHARE = 0.2
"""Share of the poses that may be outliers; with more, the whole recording is wrong."""
ERROR_RATIO = 8.0
"""Error of an outlier, over the median error; Tukey's biweight is zero there. At 6, one of
1500 sound poses of the twin in staged babbling would be an outlier."""
SPREAD_RATIO = 0.4
"""The same, over the median distance of the outermost end from its center; below it, an
error may be a motion that the regression lacks, such as hysteresis."""
LEAP = 0.5
"""Step into and out of an outlier, over its error: a true error grows in several rows."""
SWAP_RATIO = 0.3
"""Error of two swapped ends after they are exchanged, over their error before: ends that
are swapped fit each other's place as others fit theirs."""

_ITERATIONS = 20  # of the regression, which converges in about ten
_ROWS_PER_FEATURE = 5  # usual least number of a regression


class MeasuredEnds(NamedTuple):
    """Ends of modules, and the drives while each row was measured.

    Attributes:
        drives: values of the drives, in any units, shape (rows, drives).
        positions: of the ends from the base outward [m], any frame; NaN: not measured;
            shape (rows, ends, 3).
        axes: unit vectors along the arm, same frame and shape.
        stretches: number of the uninterrupted stretch to which a row belongs, shape
            (rows,).
    """

    drives: Drives
    positions: EndVectors
    axes: EndVectors
    stretches: Int[np.ndarray, " rows"]

    def without(self, is_excluded: PoseMask) -> "MeasuredEnds":
        """The same, without some poses."""
        masked = is_excluded[..., None]
        return self._replace(
            positions=np.where(masked, np.nan, self.positions),
            axes=np.where(masked, np.nan, self.axes),
        )


@dataclass(frozen=True, eq=False)
class Outliers:
    """Poses that cannot be true; each is of one kind.

    Attributes:
        frozen: pose of an earlier row, while the drives changed, shape (rows, ends).
        jumps: position or axis that no motion explains, same shape.
        swaps: position of another end, same shape.
        lengths: further from the end before it than the modules between are long, same
            shape.
        measured: whether a pose is measured at all, same shape.
    """

    frozen: PoseMask
    jumps: PoseMask
    swaps: PoseMask
    lengths: PoseMask
    measured: PoseMask

    @property
    def all(self) -> PoseMask:
        """Poses of any kind."""
        return self.frozen | self.jumps | self.swaps | self.lengths

    @property
    def count(self) -> int:
        """Number of poses of any kind."""
        return int(self.all.sum())

    @property
    def is_excessive(self) -> bool:
        """Whether more than `MAX_SHARE` of the poses of an end are outliers.

        Frozen ones do not count: they are missing poses, and the others are true.
        """
        return bool((self.shares > MAX_SHARE).any())

    @property
    def shares(self) -> Float[np.ndarray, " ends"]:
        """Share of the poses of each end that are outliers and not frozen."""
        wrong = (self.all & ~self.frozen).sum(axis=0)
        return wrong / np.maximum(self.measured.sum(axis=0), 1)

    @property
    def kinds(self) -> str:
        """Number of poses of each kind, in words."""
        counts = {
            "frozen pose": self.frozen.sum(),
            "marker jump": self.jumps.sum(),
            "swapped body": self.swaps.sum(),
            "impossible length": self.lengths.sum(),
        }
        return ", ".join(
            counted(count, kind) for kind, count in counts.items() if count
        )


def find_outliers(
    ends: MeasuredEnds, reaches: Sequence[float | None] | None = None
) -> Outliers:
    """Find the poses that cannot be true.

    Args:
        ends: measured ends.
        reaches: length of the arm between each end and the measured one before it [m];
            None where it is unknown, as for the first end.
    """
    measured = np.isfinite(ends.positions).all(axis=-1)
    poses = np.concatenate([ends.positions, ends.axes], axis=-1)
    columns = [
        find_frozen(ends.drives, pose, ends.stretches)
        for pose in np.swapaxes(poses, 0, 1)
    ]
    frozen = np.stack(columns, axis=1)
    ends = ends.without(frozen)
    positions = ends.positions
    least = SPREAD_RATIO * _spread(positions[:, -1])
    predicted = _predict(ends, positions)
    swaps = np.zeros(positions.shape[:2], bool)
    # pairs of ends that fit the drives much better when they are exchanged
    for pair in combinations(range(positions.shape[1]), 2):
        expected = predicted[:, pair]
        before = np.linalg.norm(positions[:, pair] - expected, axis=-1).min(axis=1)
        after = np.linalg.norm(positions[:, pair[::-1]] - expected, axis=-1)
        is_swap = (after.max(axis=1) < SWAP_RATIO * before) & (before > least)
        swaps[np.ix_(is_swap, pair)] = True
    # a swapped body is no jump, and its neighbors in time have true steps around it
    rest = np.where(swaps[..., None], np.nan, positions)
    is_jump = _find_jumps(rest, _predict(ends, rest), least)
    # axes are unit vectors, so the ratio itself is their least error
    is_turned = _find_jumps(ends.axes, _predict(ends, ends.axes), SPREAD_RATIO)
    is_jump |= is_turned & measured & ~swaps & ~frozen
    rest = np.where(is_jump[..., None], np.nan, rest)
    # of two ends that are too far apart, the one that fits the drives worse
    lengths = np.zeros(is_jump.shape, bool)
    errors = np.linalg.norm(rest - predicted, axis=-1)
    # without a regression, the outer end is at fault
    errors = np.where(np.isfinite(errors), errors, np.arange(rest.shape[1]))
    for outer, reach in enumerate(reaches or ()):
        if outer and reach is not None:
            chords = rest[:, outer] - rest[:, outer - 1]
            is_far = np.linalg.norm(chords, axis=-1) > (1 + STRETCH) * reach + MOUNTING
            is_inner = errors[:, outer - 1] > errors[:, outer]
            lengths[:, outer] |= is_far & ~is_inner
            lengths[:, outer - 1] |= is_far & is_inner
    return Outliers(frozen, is_jump, swaps, lengths, measured)


def _spread(values: Points) -> float:
    """Median distance from the center [m]; zero without known values."""
    known = values[np.isfinite(values).all(axis=1)]
    if not len(known):
        return 0.0
    center = np.median(known, axis=0)
    return float(np.median(np.linalg.norm(known - center, axis=1)))


def _predict(ends: MeasuredEnds, values: EndVectors) -> EndVectors:
    """Robust regression on the drives; NaN where too few rows are known."""
    predicted = np.full(values.shape, np.nan)
    has_drives = np.isfinite(ends.drives).all(axis=1)
    for end, channel in enumerate(np.swapaxes(values, 0, 1)):
        known = np.isfinite(channel).all(axis=1) & has_drives
        if known.sum() >= MIN_ROWS:
            features = _features(ends.drives[has_drives], int(known.sum()))
            weights = _robust_weights(features[known[has_drives]], channel[known])
            predicted[has_drives, end] = features @ weights
    return predicted


def _features(drives: Drives, rows: int) -> np.ndarray:
    """Quadratic features; linear ones for a fit to few rows."""
    spread = np.maximum(drives.std(axis=0), np.finfo(float).eps)
    scaled = (drives - np.median(drives, axis=0)) / spread
    linear = np.concatenate([np.ones((len(drives), 1)), scaled], axis=1)
    first, second = np.triu_indices(drives.shape[1])
    quadratic = np.concatenate([linear, scaled[:, first] * scaled[:, second]], axis=1)
    return quadratic if rows >= _ROWS_PER_FEATURE * quadratic.shape[1] else linear


def _robust_weights(features: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Iteratively reweighted least squares: first by distance, then Tukey's biweight."""
    rows = np.ones(len(features))
    for iteration in range(_ITERATIONS):
        weighted = rows[:, None] * features
        moments = weighted.T @ features
        weights = np.linalg.lstsq(moments, weighted.T @ values, rcond=1e-9)[0]
        errors = np.linalg.norm(values - features @ weights, axis=1)
        relative = errors / max(float(np.median(errors)), np.finfo(float).eps)
        if iteration < _ITERATIONS // 2:
            rows = 1 / np.maximum(1, relative)
        else:
            rows = np.clip(1 - (relative / ERROR_RATIO) ** 2, 0, 1) ** 2
    return weights


def _find_jumps(values: EndVectors, predicted: EndVectors, least: float) -> PoseMask:
    """Poses that neither the drives nor the neighbors in time explain.

    Args:
        values: positions or axes.
        predicted: from the drives.
        least: smallest error of an outlier.
    """
    is_jump = np.zeros(values.shape[:2], bool)
    for end, channel in enumerate(np.swapaxes(values, 0, 1)):
        residuals = channel - predicted[:, end]
        known = np.isfinite(residuals).all(axis=1)
        places = channel[known]
        residuals = residuals[known]
        # a row that leaps neither in time nor back in time continues a true motion
        is_jump[known, end] = (
            _leaps(places, residuals, least)
            & _leaps(places[::-1], residuals[::-1], least)[::-1]
        )
    return is_jump


def _leaps(
    places: Points, residuals: Points, least: float
) -> Bool[np.ndarray, " rows"]:
    """Rows with a large error that arises at once after the last sound row."""
    errors = np.linalg.norm(residuals, axis=1)
    usual = float(np.median(errors)) if len(errors) else 0.0
    is_leap = errors > max(ERROR_RATIO * usual, least)
    sound = -1
    for row in np.flatnonzero(is_leap):
        if row and not is_leap[row - 1]:
            sound = int(row) - 1
        if sound < 0:
            continue
        moved = np.linalg.norm(places[row] - places[sound])
        grown = np.linalg.norm(residuals[row] - residuals[sound])
        is_leap[row] = min(moved, grown) > LEAP * errors[row]
    return is_leap
