"""Segments: stretches of a take without gaps, at the control rate."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from s2c2a.errors import counted
from s2c2a.logs.errors import LogError
from s2c2a.logs.interpolation import interpolate
from s2c2a.logs.log_map import Rows
from s2c2a.logs.take import LogTake

# default longest gap, in median row intervals or control periods
DEFAULT_GAP = 4.0
MOST_APART = 20.0
"""Control periods between rows: with more, two seconds at 10 Hz, the unit of time is another."""
LEAST_APART = 2e-4
"""Seconds between rows: control rates end at 1 kHz, so with less the unit is another."""
SIGNALS = ("commanded", "measured", "positions", "axes")


def longest_gap(take: LogTake, rows: Rows, period: float) -> float:
    """Longest interval within a segment [s]: as stated, or a few row intervals.

    Raises:
        LogError: rows are too far apart to be interpolated, or closer than in any log.
    """
    if rows.longest_gap is not None:
        return rows.longest_gap
    if rows.kind == "steps":
        return np.inf
    intervals = np.diff(take.time[np.isfinite(take.time)])
    intervals = intervals[intervals > 0]
    median = float(np.median(intervals)) if len(intervals) else period
    if not LEAST_APART < median < MOST_APART * period:
        raise LogError(
            f"rows are {median:.3g} s apart, {median / period:.4g} control periods; "
            f'correct rows.unit, now "{rows.unit or "s"}", or arm.control_rate'
        )
    return DEFAULT_GAP * max(median, period)


def split_segments(take: LogTake, rows: Rows, period: float) -> list[LogTake]:
    """Split a take at gaps, unknown commands, and changes of the label.

    Timed rows are resampled to the control period.

    Args:
        take: the take.
        rows: timing of its rows.
        period: control period [s].

    Raises:
        LogError: times decrease.
    """
    limit = longest_gap(take, rows, period)
    valid = np.isfinite(take.time) & np.isfinite(take.commands).all(axis=1)
    kept = np.flatnonzero(valid)
    times = take.time[kept]
    falls = np.flatnonzero(np.diff(times) < 0)
    if len(falls):
        row = falls[0]
        raise LogError(
            f"times fall from {times[row]:.6g} to {times[row + 1]:.6g} s after "
            f"{counted(row + 1, 'valid row')}; sort the rows, or split the file where "
            "the clock was set back"
        )
    # of rows with the same time, the first counts
    waits = np.diff(take.time[kept], prepend=-np.inf)
    kept = kept[waits > 0]
    known = select_rows(take, kept)
    invalid_count = np.cumsum(~valid)[kept]
    is_border = np.diff(known.time) > limit
    is_border |= known.labels[1:] != known.labels[:-1]
    is_border |= np.diff(invalid_count) > 0
    edges = [0, *(np.flatnonzero(is_border) + 1), len(known)]
    segments = []
    for begin, end in pairwise(edges):
        segment = select_rows(known, slice(begin, end))
        if rows.kind == "timed" and len(segment) > 1:
            segment = _resample(segment, period, limit)
        if len(segment) >= rows.shortest:
            segments.append(segment)
    return segments


def select_rows(take: LogTake, rows: np.ndarray | slice) -> LogTake:
    """Take of some rows."""
    names = ("time", *SIGNALS, "labels")
    return replace(take, **{name: getattr(take, name)[rows] for name in names})


def _resample(segment: LogTake, period: float, limit: float) -> LogTake:
    times = segment.time
    duration = times[-1] - times[0]
    count = int(duration / period + 1e-6) + 1
    samples = times[0] + period * np.arange(count)
    # rounding could put the last sample behind the end
    samples = np.minimum(samples, times[-1])
    columns: dict[str, Any] = {
        name: interpolate(times, getattr(segment, name), samples, limit)
        for name in SIGNALS
    }
    lengths = np.linalg.norm(columns["axes"], axis=-1, keepdims=True)
    columns["axes"] = columns["axes"] / np.where(lengths > 0, lengths, np.nan)
    after = np.searchsorted(times, samples, side="right").clip(1, len(times) - 1)
    labels = segment.labels[after - 1]
    return replace(segment, time=samples, labels=labels, **columns)
