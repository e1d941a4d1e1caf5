"""Candidates for the offset and drift of two clocks: peaks of a correlation of speeds."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.signal import correlate, correlation_lags, find_peaks

from s2c2a.logs.timed_motion import TimedMotion

DRIFTS = 500e-6 * np.linspace(-1, 1, 21)
"""Drifts of the search; clocks of computers and cameras are within 100 ppm."""
CANDIDATES = 4  # peaks of the correlation that are refined
LEAST_ENERGY = 1e-9  # of speeds that overlap, relative; less is rounding
SEPARATION = 3  # distance of candidates, in steps of the grid


class ClockCandidate(NamedTuple):
    """A peak of the correlation.

    Attributes:
        correlation: of the speeds.
        offset: clock of the drives minus that of the ends [s], at the ends' middle.
        drift: seconds that the first clock gains per second of the later one.
    """

    correlation: float
    offset: float
    drift: float


def search_clocks(
    drives: TimedMotion, ends: TimedMotion, step: float
) -> list[ClockCandidate]:
    """Highest peaks of the correlation of speeds, over offsets and drifts.

    Args:
        drives: drives from time 0 on.
        ends: ends from time 0 on.
        step: interval of the grid in time [s].
    """
    drifts = DRIFTS
    if ends.span * DRIFTS.max() < step:
        drifts = np.zeros(1)
    speeds = _speeds(drives, step)
    peaks: list[ClockCandidate] = []
    for drift in drifts:
        peaks += _peaks(speeds, ends, drift, step)
    # highest peaks whose offsets differ by more than a distance
    distance = SEPARATION * step
    chosen: list[ClockCandidate] = []
    for peak in sorted(peaks, reverse=True):
        distances = [abs(peak.offset - other.offset) for other in chosen]
        if min(distances, default=np.inf) > distance:
            chosen.append(peak)
    return chosen[:CANDIDATES]


def _peaks(
    speeds: np.ndarray, ends: TimedMotion, drift: float, step: float
) -> list[ClockCandidate]:
    """Peaks of the correlation at one drift."""
    middle = ends.span / 2
    time = ends.time + drift * (ends.time - middle)
    start = time[0]
    shifted = TimedMotion(time - start, ends.values)
    # correlation of two signals with gaps where at least half of one overlaps
    first, known = _centered(speeds)
    later, later_known = _centered(_speeds(shifted, step))
    products = _sums(first, later)
    energy = _sums(first**2, later_known)
    energy *= _sums(known, later**2)
    shorter = min(known.sum(), later_known.sum())
    overlap = _sums(known, later_known)
    valid = overlap > 0.5 * shorter - 0.5
    valid &= energy > LEAST_ENERGY * energy.max()
    scale = np.sqrt(energy[valid])
    values = np.full(len(products), -1.0)
    values[valid] = products[valid] / scale
    lags = correlation_lags(len(first), len(later))
    indices, _ = find_peaks(values, distance=SEPARATION)
    order = np.argsort(values[indices])
    highest = indices[order[-CANDIDATES:]]
    offsets = lags * step - start
    return [
        ClockCandidate(correlation=values[index], offset=offsets[index], drift=drift)
        for index in highest
    ]


def _speeds(motion: TimedMotion, step: float) -> Float[np.ndarray, " cells"]:
    """Speeds on a grid, from means of its cells; NaN where a cell is empty."""
    cells = np.floor(motion.time / step)
    count = np.bincount(cells.astype(int))
    sums = [np.bincount(cells.astype(int), channel) for channel in motion.values.T]
    with np.errstate(invalid="ignore"):
        means = np.array(sums) / count
    differences = np.diff(means)
    speeds = np.linalg.norm(differences, axis=0)
    # the root weighs slow motion like fast motion
    return np.sqrt(speeds)


def _centered(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signal without its mean, 0 where it is unknown; and 1 where it is known."""
    known = np.isfinite(signal)
    centered = signal - np.nanmean(signal)
    return np.nan_to_num(centered), known.astype(float)


def _sums(first: np.ndarray, later: np.ndarray) -> np.ndarray:
    """Sums of products at every lag."""
    return correlate(first, later, method="fft")
