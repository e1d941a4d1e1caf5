"""Motion of the frame within a log: a camera that was knocked, or that drifts.

Rows with similar drives, far apart in time, have the same poses but for noise and
hysteresis. If all ends differ by one shift wherever one row is before and the other
after some time, the frame has jumped; if the difference grows with the time between
them, it drifts. Hysteresis and creep explain as much in a log of few motions: there,
the same is found when blocks of the log are permuted (a permutation test).
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from s2c2a.logs.interpolation import evenly_spread
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.take import Drives, Ends, LogTake, effective_drives

RowNumbers = Int[np.ndarray, " rows"]
Centers = Float[np.ndarray, "rows 3"]
EXPLAINED = 0.07
"""Share of all differences of similar rows that a motion of the frame must explain.
Clean logs of two arms reach 0.005 to 0.045, and 0.06 where drives hardly return to old
values; a jump by 5.8 mm in the middle reaches 0.07 to 0.24, a drift by 7 mm 0.06 to 0.16.
"""

_BLOCKS = 8  # of a log; each is longer than hysteresis lasts
_PERMUTATIONS = 40
_BY_CHANCE = 2  # permutations that may explain more: 5 %
_REFERENCES = 3000  # rows, evenly spread
_NEIGHBORS = 46
_SIMILAR = 6
_APART = 20  # rows of the references between similar rows
_TIMES = 61  # times of a jump that are tried
_MIN_PAIRS = 20
_MIN_ROWS = 300  # in fewer, hysteresis looks like a motion of the frame
_LEAST = 1e-12


class _Pairs(NamedTuple):
    """Later and earlier rows with similar drives, and the shift between them [m]."""

    later: Int[np.ndarray, " pairs"]
    earlier: Int[np.ndarray, " pairs"]
    shifts: Float[np.ndarray, "pairs 3"]


class FrameMotion(NamedTuple):
    """A jump or drift of the frame within one log.

    Attributes:
        explained: share of the differences of similar rows that it explains.
        text: size, time, and what to do.
        row: of the jump, from 0; -1 for a drift.
        log: number of the log, from 0.
    """

    explained: float
    text: str
    row: int = -1
    log: int = 0


def find_frame_motions(
    takes: Sequence[LogTake], log_map: LogMap
) -> tuple[FrameMotion, ...]:
    """Find jumps and drifts of the frame within logs; the largest of each log."""
    motions = []
    for number, take in enumerate(takes):
        motion = find_frame_motion(
            effective_drives(take, log_map), take.positions, take.time
        )
        if motion is not None:
            log = f"log {number + 1}: " if len(takes) > 1 else ""
            motions.append(motion._replace(text=log + motion.text, log=number))
    return tuple(motions)


def find_frame_motion(
    drives: Drives,
    positions: Ends,
    time: Float[np.ndarray, " rows"],
) -> FrameMotion | None:
    """Find a jump or drift of the frame in one log, if there is one.

    Args:
        drives: values of the drives while each row was measured, in any units.
        positions: of the ends [m]; NaN: not measured.
        time: of the rows [s].
    """
    known = np.isfinite(drives).all(axis=1) & np.isfinite(time)
    known &= np.isfinite(positions).all(axis=(1, 2))
    rows = np.flatnonzero(known)
    if len(rows) < _MIN_ROWS:
        return None
    rows = rows[evenly_spread(len(rows), _REFERENCES)]
    drives = drives[rows]
    centers = positions[rows].mean(axis=1)
    motion = _largest_motion(drives, centers, rows, time)
    if motion.explained <= EXPLAINED:
        return None
    by_chance = (
        _largest_motion(drives[order], centers[order], rows, time).explained
        >= motion.explained
        for order in _permutations(len(rows))
    )
    exceptions = islice(filter(None, by_chance), _BY_CHANCE + 1)
    return motion if len(list(exceptions)) <= _BY_CHANCE else None


def _largest_motion(
    drives: Drives,
    centers: Centers,
    rows: RowNumbers,
    time: Float[np.ndarray, " all"],
) -> FrameMotion:
    """The jump or drift that explains most."""
    count = len(drives)
    scaled = drives / (drives.std(axis=0) + _LEAST)
    distances, earlier = KDTree(scaled).query(scaled, k=min(_NEIGHBORS, count))
    later = np.broadcast_to(np.arange(count)[:, None], earlier.shape)
    is_pair = later - earlier > _APART
    is_pair &= np.cumsum(is_pair, axis=1) <= _SIMILAR
    if is_pair.any():
        is_pair &= distances <= np.median(distances[is_pair])
    later = later[is_pair]
    earlier = earlier[is_pair]
    # drives are similar, not equal: a smooth map explains the rest
    centers = centers - _smooth_map(scaled, centers)
    pairs = _Pairs(later, earlier, centers[later] - centers[earlier])
    if len(pairs.later) < _MIN_PAIRS:
        return FrameMotion(0.0, "")
    return max(_jump(pairs, rows, time), _drift(pairs, len(rows)))


def _permutations(count: int) -> Iterator[RowNumbers]:
    """Orders of rows in which blocks are permuted."""
    random = np.random.default_rng(0)
    blocks = np.array_split(np.arange(count), _BLOCKS)
    for _ in range(_PERMUTATIONS):
        yield np.concatenate([blocks[k] for k in random.permutation(_BLOCKS)])


def quadratic_terms(
    values: Drives,
) -> Float[np.ndarray, "rows terms"]:
    """One, the values, and the products of two of them."""
    first, second = np.triu_indices(values.shape[1])
    products = values[:, first] * values[:, second]
    return np.hstack([np.ones((len(values), 1)), values, products])


def _smooth_map(drives: Drives, centers: Centers) -> Centers:
    """Quadratic regression of the ends' center on the drives."""
    features = quadratic_terms(drives - drives.mean(axis=0))
    return features @ np.linalg.lstsq(features, centers, rcond=1e-9)[0]


def _jump(
    pairs: _Pairs, rows: RowNumbers, time: Float[np.ndarray, " rows"]
) -> FrameMotion:
    """The time at which one shift explains most."""
    lengths = np.linalg.norm(pairs.shifts, axis=1)
    best = FrameMotion(0.0, "")
    for split in np.linspace(0.05, 0.95, _TIMES) * len(rows):
        begin = round(split)
        across = (pairs.later >= begin) & (pairs.earlier < begin)
        if across.sum() < _MIN_PAIRS:
            continue
        shift = np.median(pairs.shifts[across], axis=0)
        left = np.linalg.norm(pairs.shifts[across] - shift, axis=1).sum()
        explained = (lengths[across].sum() - left) / (lengths.sum() + _LEAST)
        row = int(rows[begin])
        text = (
            f"all ends jump by {_size(shift)} about row {row} "
            f"({time[row] - time[0]:.1f} s): a camera or the base was moved, or motors "
            "were homed anew; import the rows before and after it as two logs"
        )
        best = max(best, FrameMotion(float(explained), text, row))
    return best


def _drift(pairs: _Pairs, count: int) -> FrameMotion:
    """A shift that grows with the time between rows."""
    ages = ((pairs.later - pairs.earlier) / count)[:, None]
    drift = np.median(pairs.shifts / ages, axis=0)
    left = np.linalg.norm(pairs.shifts - ages * drift, axis=1).sum()
    total = np.linalg.norm(pairs.shifts, axis=1).sum()
    text = (
        f"all ends drift by about {_size(drift)} over the log: a camera, the base, or "
        "the motors' zeros drift; the model takes the mean"
    )
    return FrameMotion(float(1 - left / (total + _LEAST)), text)


def _size(shift: Float[np.ndarray, "3"]) -> str:
    values = ", ".join(f"{1e3 * value:.1f}" for value in shift)
    return (
        f"{1e3 * np.linalg.norm(shift):.1f} mm, ({values}) mm in the frame of the log"
    )
