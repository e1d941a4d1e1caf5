"""Frozen ends: a tracker that has lost a body repeats its last pose.

A repeated pose is no proof: an arm at rest, or a log of few digits, has equal rows, too.
It is excluded if the drives changed meanwhile, and rows with like changes of the drives
moved so much further than the log's resolution that an equal pose is no chance. If digits
hide the noise, the end must also catch up afterwards, as an arm within its backlash does
not.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import KDTree

from s2c2a.measurements.repeats import repeated_rows

RowNumbers = Int[np.ndarray, " rows"]
RowMask = Bool[np.ndarray, " rows"]
FALSE_RUNS = 0.01
"""Runs of equal poses that a whole log may have by chance."""

_LIKE = 31  # rows with like changes of the drives; odd, for a median
MIN_ROWS = 20  # of a comparison among rows
_CALM_SHARE = 0.05  # of the steps: those in which drives rest most
_ARITHMETIC = 1e-10  # relative error of numbers that were computed
_LONGEST = 64  # rows over which motion is compared; a longer run shows no more

Drives = Float[np.ndarray, "rows drives"]
Points = Float[np.ndarray, "rows 3"]


def find_frozen(
    drives: Drives, poses: Float[np.ndarray, "rows numbers"], stretches: RowNumbers
) -> RowMask:
    """Find the rows in which the pose of one end is only repeated.

    Args:
        drives: values of the drives while each row was measured, in any units.
        poses: position of the end [m], and whatever else was measured of it; a row
            without a position is not measured.
        stretches: number of the uninterrupted stretch to which a row belongs.
    """
    known = np.isfinite(poses[:, :3]).all(axis=1) & np.isfinite(drives).all(axis=1)
    is_frozen = np.zeros(len(poses), bool)
    if known.sum() < MIN_ROWS:
        return is_frozen
    is_repeated = repeated_rows(poses[known])
    is_repeated[1:] &= np.diff(stretches[known]) == 0
    if not is_repeated.any():
        return is_frozen
    rows = _Rows(drives[known], poses[known, :3], stretches[known])
    may_rest = rows.has_hidden_noise(is_repeated)
    numbers = np.flatnonzero(known)
    edges = np.flatnonzero(np.diff(is_repeated, append=False, prepend=False))
    for begin, end in edges.reshape(-1, 2).tolist():
        first = rows.last_at_rest(begin - 1, end)
        repeated = range(first + 1, end)
        if may_rest and not rows.has_caught_up(first, end):
            continue
        if any(len(rows) * rows.chance(first, row) < FALSE_RUNS for row in repeated):
            is_frozen[numbers[first + 1 : end]] = True
    return is_frozen


class _Rows:
    """Rows with a pose: how far do ends move while drives change by as much?"""

    def __init__(self, drives: Drives, positions: Points, stretches: RowNumbers):
        self._drives = drives / (drives.std(axis=0) + 1e-12)
        self._positions = positions
        self._stretches = stretches
        self._resolution = np.array([_resolution(values) for values in positions.T])
        self._trees: dict[int, tuple[KDTree, np.ndarray]] = {}

    def __len__(self) -> int:
        """Number of rows."""
        return len(self._positions)

    def has_hidden_noise(self, is_repeated: RowMask) -> bool:
        """Whether poses are equal where drives rest: digits hide noise, if there is any.

        Then equal poses alone prove nothing: the arm may rest within its backlash.
        """
        steps = np.linalg.norm(np.diff(self._drives, axis=0), axis=1)
        is_calm = steps <= np.quantile(steps, _CALM_SHARE)
        return bool(is_repeated[1:][is_calm].mean() > 0.5)

    def last_at_rest(self, first: int, end: int) -> int:
        """The last row, from the first one on, before the drives change."""
        changed = (self._drives[first:end] != self._drives[first]).any(axis=1)
        return first + int(np.argmax(changed)) - 1 if changed.any() else end - 1

    def has_caught_up(self, first: int, end: int) -> bool:
        """Whether the end then moves as if over all rows, rather than over one row."""
        if end >= len(self) or self._stretches[end] != self._stretches[first]:
            return False
        moved = np.linalg.norm(self._positions[end] - self._positions[first])
        single = np.linalg.norm(self._usual_motion(end - 1, end))
        whole = np.linalg.norm(self._usual_motion(first, end))
        return bool(moved**2 > single * whole)

    def chance(self, first: int, last: int) -> float:
        """Chance that a measured pose of the last row equals that of the first one.

        Each equal number is a chance of about the resolution over the usual motion.
        """
        usual = self._usual_motion(first, last)
        chances = self._resolution / (2 * usual + self._resolution)
        return float(np.prod(chances))

    def _usual_motion(self, first: int, last: int) -> Float[np.ndarray, "3"]:
        """Median motion [m] while drives change as between two rows."""
        lag = min(last - first, _LONGEST)
        tree, motions = self._motions(lag)
        count = min(_LIKE, len(motions))
        like = tree.query(self._changes(np.array([last]), lag)[0], k=count)[1]
        return np.median(motions[np.atleast_1d(like)], axis=0)

    def _motions(self, lag: int) -> tuple[KDTree, Points]:
        """Changes of the drives over some rows, and motions of the end meanwhile."""
        if lag not in self._trees:
            last = np.arange(lag, len(self))
            last = last[self._stretches[last] == self._stretches[last - lag]]
            motions = np.abs(self._positions[last] - self._positions[last - lag])
            self._trees[lag] = KDTree(self._changes(last, lag)), motions
        return self._trees[lag]

    def _changes(self, last: RowNumbers, lag: int) -> Float[np.ndarray, "rows lags"]:
        """Sizes of the changes since 1, 2, 4, ... rows: when the drives changed, too.

        An arm that has not yet answered to the last change is like others that have not.
        """
        lags = [*(2**power for power in range(lag.bit_length()) if 2**power < lag), lag]
        changes = [self._drives[last] - self._drives[last - lag] for lag in lags]
        return np.stack([np.linalg.norm(change, axis=1) for change in changes], axis=1)


def _resolution(values: Float[np.ndarray, " rows"]) -> float:
    """Smallest difference of two numbers [m], except for those of the arithmetic."""
    differences = np.diff(np.unique(values))
    differences = differences[differences > _ARITHMETIC * np.abs(values).max()]
    return float(differences.min(initial=1.0))
