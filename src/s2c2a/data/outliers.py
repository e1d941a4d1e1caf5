"""Outliers of measured module ends: frozen, jumped or swapped bodies, wrong lengths.

A pose, which is one end in one row, is compared with a robust regression on the drives,
with rows of similar drives, and with its neighbors in time. Poses that are only repeated
are found before (`data.frozen_ends`), so that they calibrate nothing.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import median_filter
from scipy.spatial import KDTree

from s2c2a.data.frozen_ends import find_frozen
from s2c2a.lab.tracking.plausibility import MOUNTING, STRETCH

MAX_SHARE = 0.2
"""Share of the poses that may be outliers; with more, the whole recording is wrong."""
ERROR_RATIO = 8.0
"""Error of an outlier, over the usual error in rows with similar drives."""
DENSE_RATIO = 5.0
"""The same where rows are dense in time, so that their order is evidence, too."""
DENSE_STEP = 0.6
"""Median step of the error, over the median error, below which rows are dense."""
STEP_RATIO = 4.0
"""Step of the error into and out of an outlier, over the usual step."""
BREAK_RATIO = 0.5
"""The same, over the error itself: a true error grows in several steps."""
SPREAD_RATIO = 0.4
"""Error of an outlier, over the median distance of the outermost end from its center."""
MIN_CANDIDATES = 0.7
"""Share of the rows between two breaks that have such an error."""
SWAP_RATIO = 0.3
"""Error of two swapped ends after they are exchanged, over their error before."""
LENGTH_RATIO = 1.4
"""Impossible distance of two ends of modules of unknown length, over its upper
quartile."""

_ITERATIONS = 20
_TUKEY = 6.0  # median errors from which a row has no weight
_ROWS_PER_FEATURE = 5
_MIN_ROWS = 20
_REFERENCES = 2000  # rows among which similar ones are sought
_SIMILAR = 16
_WINDOW = 25  # rows on either side that show the usual step, and are not similar rows
_LEAST = 1e-9  # m


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

    drives: Float[np.ndarray, "rows drives"]
    positions: Float[np.ndarray, "rows ends 3"]
    axes: Float[np.ndarray, "rows ends 3"]
    stretches: Int[np.ndarray, " rows"]

    def without(self, is_excluded: Bool[np.ndarray, "rows ends"]) -> "MeasuredEnds":
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

    frozen: Bool[np.ndarray, "rows ends"]
    jumps: Bool[np.ndarray, "rows ends"]
    swaps: Bool[np.ndarray, "rows ends"]
    lengths: Bool[np.ndarray, "rows ends"]
    measured: Bool[np.ndarray, "rows ends"]

    @property
    def all(self) -> Bool[np.ndarray, "rows ends"]:
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
            _count(int(count), kind) for kind, count in counts.items() if count
        )


def _count(count: int, kind: str) -> str:
    """Number and noun, such as "3 swapped bodies"."""
    plural = kind.removesuffix("y") + "ies" if kind.endswith("y") else kind + "s"
    return f"{count} {kind if count == 1 else plural}"


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
    frozen = _find_frozen(ends)
    ends = ends.without(frozen)
    positions = ends.positions
    least = SPREAD_RATIO * _spread(positions[:, -1])
    predicted = np.stack([_predict(ends, end) for end in _channels(positions)], axis=1)
    swaps = _find_swaps(positions, predicted, least)
    # a swapped body is no jump, and its neighbors in time have true steps around it
    rest = np.where(swaps[..., None], np.nan, positions)
    jumps = [_find_jumps(ends, end, least) for end in _channels(rest)]
    # axes are unit vectors, so the ratio itself is their least error
    turned = [_find_jumps(ends, axis, SPREAD_RATIO) for axis in _channels(ends.axes)]
    is_jump = np.stack(jumps, axis=1) | (np.stack(turned, axis=1) & measured & ~swaps)
    is_jump &= ~frozen
    rest = np.where(is_jump[..., None], np.nan, rest)
    lengths = _find_lengths(rest, predicted, reaches or [None] * len(jumps))
    return Outliers(frozen, is_jump, swaps, lengths, measured)


def _find_frozen(ends: MeasuredEnds) -> Bool[np.ndarray, "rows ends"]:
    poses = np.concatenate([ends.positions, ends.axes], axis=-1)
    columns = [
        find_frozen(ends.drives, pose, ends.stretches) for pose in _channels(poses)
    ]
    return np.stack(columns, axis=1)


def _channels(values: Float[np.ndarray, "rows ends 3"]) -> Iterator[np.ndarray]:
    """Values of each end, shape (rows, 3)."""
    return iter(np.swapaxes(values, 0, 1))


def _spread(values: Float[np.ndarray, "rows 3"]) -> float:
    """Median distance from the center [m]; zero without known values."""
    known = values[np.isfinite(values).all(axis=1)]
    if not len(known):
        return 0.0
    center = np.median(known, axis=0)
    return float(np.median(np.linalg.norm(known - center, axis=1)))


def _known(ends: MeasuredEnds, values: np.ndarray) -> Bool[np.ndarray, " rows"]:
    """Rows in which drives and values are known; none if there are too few."""
    known = np.isfinite(values).all(axis=1) & np.isfinite(ends.drives).all(axis=1)
    return known if known.sum() >= _MIN_ROWS else np.zeros(len(values), bool)


def _predict(
    ends: MeasuredEnds, values: Float[np.ndarray, "rows 3"]
) -> Float[np.ndarray, "rows 3"]:
    """Robust regression on the drives; NaN where it is not possible."""
    known = _known(ends, values)
    predicted = np.full(values.shape, np.nan)
    if known.any():
        has_drives = np.isfinite(ends.drives).all(axis=1)
        features = _features(_normalize(ends.drives[has_drives]), int(known.sum()))
        weights = _robust_weights(features[known[has_drives]], values[known])
        predicted[has_drives] = features @ weights
    return predicted


def _normalize(drives: np.ndarray) -> np.ndarray:
    return (drives - np.median(drives, axis=0)) / (drives.std(axis=0) + 1e-12)


def _features(drives: Float[np.ndarray, "rows drives"], rows: int) -> np.ndarray:
    """Quadratic features; linear ones, or a constant, for a fit to few rows."""
    count = drives.shape[1]
    linear = np.concatenate([np.ones((len(drives), 1)), drives], axis=1)
    first, second = np.triu_indices(count)
    quadratic = np.concatenate([linear, drives[:, first] * drives[:, second]], axis=1)
    for features in (quadratic, linear):
        if rows >= _ROWS_PER_FEATURE * features.shape[1]:
            return features
    return linear[:, :1]


def _robust_weights(features: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Iteratively reweighted least squares: first by distance, then Tukey's biweight."""
    rows = np.ones(len(features))
    for iteration in range(_ITERATIONS):
        weighted = rows[:, None] * features
        moments = weighted.T @ features
        weights = np.linalg.lstsq(moments, weighted.T @ values, rcond=1e-9)[0]
        errors = np.linalg.norm(values - features @ weights, axis=1)
        relative = errors / (np.median(errors) + _LEAST)
        if iteration < _ITERATIONS // 2:
            rows = 1 / np.maximum(1, relative)
        else:
            rows = np.clip(1 - (relative / _TUKEY) ** 2, 0, 1) ** 2
    return weights


def _find_jumps(
    ends: MeasuredEnds, values: Float[np.ndarray, "rows 3"], least: float
) -> Bool[np.ndarray, " rows"]:
    """Rows that neither the drives nor the neighbors in time explain.

    Args:
        ends: the drives.
        values: positions or axes of one end.
        least: smallest error of an outlier.
    """
    known = _known(ends, values)
    is_jump = np.zeros(len(values), bool)
    if not known.any():
        return is_jump
    residuals = (values - _predict(ends, values))[known]
    errors, scales = _unexplained(_normalize(ends.drives[known]), residuals)
    steps = np.linalg.norm(np.diff(residuals, axis=0), axis=1)
    is_dense = np.median(steps) < DENSE_STEP * np.median(errors)
    ratio = DENSE_RATIO if is_dense else ERROR_RATIO
    is_candidate = errors > np.maximum(ratio * scales, least)
    is_border = np.diff(ends.stretches[known]) != 0
    places = values[known]
    pieces = _Pieces.of(is_border | _breaks(places, residuals, errors))

    def is_near(row: int, other: int) -> bool:
        distance = np.linalg.norm(residuals[row] - residuals[other])
        moved = np.linalg.norm(places[row] - places[other])
        return bool(min(distance, moved) < BREAK_RATIO * errors[row])

    is_jump[known] = _select_pieces(is_candidate, pieces, is_near)
    return is_jump


def _unexplained(
    drives: np.ndarray, residuals: Float[np.ndarray, "rows 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """Errors that rows with similar drives do not share, and their usual size there."""
    similar = _similar_rows(drives)
    others = residuals[similar]
    centers = np.median(others, axis=1)
    scatter = np.median(np.linalg.norm(others - centers[:, None], axis=-1), axis=1)
    errors = np.linalg.norm(residuals, axis=1)
    errors = np.minimum(errors, np.linalg.norm(residuals - centers, axis=1))
    return errors, np.maximum(scatter, np.median(errors))


def _similar_rows(drives: np.ndarray) -> Int[np.ndarray, "rows similar"]:
    """Rows with the most similar drives that are not neighbors in time."""
    rows = len(drives)
    references = np.linspace(0, rows - 1, min(rows, _REFERENCES)).astype(int)
    count = min(2 * _WINDOW + 1 + _SIMILAR, len(references))
    nearest = KDTree(drives[references]).query(drives, k=count)[1]
    similar = references[nearest]
    is_neighbor = np.abs(similar - np.arange(rows)[:, None]) <= _WINDOW
    order = np.argsort(is_neighbor, axis=1, kind="stable")[:, :_SIMILAR]
    return np.take_along_axis(similar, order, axis=1)


def _breaks(
    values: np.ndarray, residuals: np.ndarray, errors: np.ndarray
) -> Bool[np.ndarray, " steps"]:
    """Steps that are too large, also in view of the steps of the drives."""
    steps = np.linalg.norm(np.diff(residuals, axis=0), axis=1)
    usual = median_filter(steps, 2 * _WINDOW + 1, mode="mirror")
    moved = np.linalg.norm(np.diff(values, axis=0), axis=1)
    larger = np.maximum(errors[1:], errors[:-1])
    least = np.maximum(STEP_RATIO * usual, BREAK_RATIO * larger)
    return np.minimum(steps, moved) > least


class _Pieces(NamedTuple):
    """Rows between two breaks, or the ends of a log.

    Attributes:
        begins: first row of each piece, shape (pieces,).
        ends: row after its last one.
    """

    begins: Int[np.ndarray, " pieces"]
    ends: Int[np.ndarray, " pieces"]

    @classmethod
    def of(cls, is_break: Bool[np.ndarray, " steps"]) -> "_Pieces":
        """Split rows at breaks."""
        edges = np.flatnonzero(np.concatenate([[True], is_break, [True]]))
        return cls(edges[:-1], edges[1:])

    def shares(self, is_candidate: np.ndarray) -> Float[np.ndarray, " pieces"]:
        """Share of candidates in each piece."""
        counts = np.add.reduceat(is_candidate.astype(float), self.begins)
        return counts / (self.ends - self.begins)


def _select_pieces(
    is_candidate: Bool[np.ndarray, " rows"],
    pieces: _Pieces,
    is_near: Callable[[int, int], bool],
) -> Bool[np.ndarray, " rows"]:
    """Rows of pieces that are mostly candidates, and not continued by other pieces.

    Args:
        is_candidate: rows with a large error.
        pieces: of the rows.
        is_near: whether a row, the first argument, continues another one.
    """
    wrong = pieces.shares(is_candidate) > MIN_CANDIDATES
    restored = True
    while restored:
        restored = False
        for piece in np.flatnonzero(wrong):
            first = pieces.begins[piece]
            last = pieces.ends[piece] - 1
            right = np.flatnonzero(~wrong)
            place = int(np.searchsorted(right, piece))
            before = pieces.ends[right[max(place - 1, 0) : place]] - 1
            after = pieces.begins[right[place : place + 1]]
            if any(is_near(first, row) for row in before) or any(
                is_near(last, row) for row in after
            ):
                wrong[piece] = False
                restored = True
    return np.repeat(wrong, pieces.ends - pieces.begins)


def _find_swaps(
    positions: Float[np.ndarray, "rows ends 3"],
    predicted: Float[np.ndarray, "rows ends 3"],
    least: float,
) -> Bool[np.ndarray, "rows ends"]:
    """Pairs of ends that fit the drives much better when they are exchanged."""
    swaps = np.zeros(positions.shape[:2], bool)
    for pair in combinations(range(positions.shape[1]), 2):
        measured = positions[:, pair]
        expected = predicted[:, pair]
        before = np.linalg.norm(measured - expected, axis=-1)
        after = np.linalg.norm(measured[:, ::-1] - expected, axis=-1)
        is_better = after.max(axis=1) < SWAP_RATIO * before.min(axis=1)
        is_swap = is_better & (before.min(axis=1) > least)
        swaps[np.ix_(is_swap, pair)] = True
    return swaps


def _find_lengths(
    positions: Float[np.ndarray, "rows ends 3"],
    predicted: Float[np.ndarray, "rows ends 3"],
    reaches: Sequence[float | None],
) -> Bool[np.ndarray, "rows ends"]:
    """Of two ends that are too far apart, the one that fits the drives worse."""
    errors = np.linalg.norm(positions - predicted, axis=-1)
    # without a regression, the outer end is at fault
    errors = np.where(np.isfinite(errors), errors, np.arange(len(reaches)))
    impossible = np.zeros(positions.shape[:2], bool)
    for outer in range(1, len(reaches)):
        chords = positions[:, outer] - positions[:, outer - 1]
        distances = np.linalg.norm(chords, axis=-1)
        is_far = distances > _longest(distances, reaches[outer])
        is_inner = errors[:, outer - 1] > errors[:, outer]
        impossible[:, outer] |= is_far & ~is_inner
        impossible[:, outer - 1] |= is_far & is_inner
    return impossible


def _longest(distances: np.ndarray, reach: float | None) -> float:
    """Largest possible distance of two ends [m]."""
    if reach is not None:
        return (1 + STRETCH) * reach + MOUNTING
    known = distances[np.isfinite(distances)]
    if not len(known):
        return np.inf
    return LENGTH_RATIO * float(np.quantile(known, 0.75)) + MOUNTING
