"""From rows to steps: moments at the control rate, and stretches without a gap. Nothing is filled in across a gap."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from s2c2a.logs.errors import LogError
from s2c2a.logs.map import Rows
from s2c2a.logs.session import Session

# usual intervals, or control periods, beyond which nothing is interpolated if nothing
# is stated
USUAL_GAPS = 4.0


def longest_gap(session: Session, rows: Rows, period: float) -> float:
    """Beyond this rows do not belong together [s]: as stated, else a few usual intervals."""
    if rows.longest_gap is not None:
        return rows.longest_gap
    if rows.kind == "steps":
        return np.inf
    intervals = np.diff(session.time[np.isfinite(session.time)])
    usual = (
        float(np.median(intervals[intervals > 0])) if (intervals > 0).any() else period
    )
    return USUAL_GAPS * max(usual, period)


def stretches(session: Session, rows: Rows, period: float) -> list[Session]:
    """Parts of a session in which steps follow each other: between gaps, unknown commands and changes of the label.

    Args:
        session: as it was logged.
        rows: how.
        period: of the control steps [s].

    Raises:
        LogError: times do not rise.
    """
    limit = longest_gap(session, rows, period)
    sound = np.isfinite(session.time) & np.isfinite(told(session)).all(axis=1)
    kept = np.flatnonzero(sound)
    _check_rising(session.time[kept])
    # the first of rows of one moment
    kept = kept[np.diff(session.time[kept], prepend=-np.inf) > 0]
    known = chosen(session, kept)
    lost = np.cumsum(~sound)[kept]
    borders = (
        (np.diff(known.time) > limit)
        | (known.labels[1:] != known.labels[:-1])
        | (np.diff(lost) > 0)
    )
    edges = [0, *(np.flatnonzero(borders) + 1), len(known)]
    parts = [chosen(known, slice(*ends)) for ends in pairwise(edges)]
    if rows.kind == "timed":
        parts = [_resampled(part, period, limit) for part in parts if len(part) > 1]
    return [part for part in parts if len(part) >= rows.shortest]


def chosen(session: Session, rows: np.ndarray | slice) -> Session:
    """Some rows of a session."""
    names = ("time", "commanded", "measured", "positions", "axes", "labels")
    return replace(session, **{name: getattr(session, name)[rows] for name in names})


def told(session: Session) -> np.ndarray:
    """What drives were told, else what they did: an episode needs all of it."""
    return np.where(
        np.isfinite(session.commanded).any(axis=0), session.commanded, session.measured
    )


def _check_rising(times: np.ndarray) -> None:
    falls = np.flatnonzero(np.diff(times) < 0)
    if len(falls):
        place = falls[0]
        raise LogError(
            f"times fall from {times[place]:.6g} to {times[place + 1]:.6g} s after {place + 1} rows that can be used; "
            "sort them, or split the file where the clock was set back"
        )


def _resampled(part: Session, period: float, limit: float) -> Session:
    moments = part.time[0] + period * np.arange(
        int((part.time[-1] - part.time[0]) / period + 1e-6) + 1
    )
    # rounded up, the last one would lie behind the end
    moments = np.minimum(moments, part.time[-1])
    after = np.searchsorted(part.time, moments, side="right").clip(1, len(part) - 1)
    columns: dict[str, Any] = {
        name: interpolated(part.time, getattr(part, name), moments, limit)
        for name in ("commanded", "measured", "positions", "axes")
    }
    lengths = np.linalg.norm(columns["axes"], axis=-1, keepdims=True)
    columns["axes"] = columns["axes"] / np.where(lengths > 0, lengths, np.nan)
    return replace(part, time=moments, labels=part.labels[after - 1], **columns)


def interpolated(
    time: np.ndarray, values: np.ndarray, moments: np.ndarray, limit: float
) -> np.ndarray:
    """Values at other moments, on straight lines between neighbors; NaN where those are further apart than a limit.

    Each channel has its own neighbors: one that was not seen for a moment does not
    hide the others.
    """
    flat = values.reshape(len(values), -1)
    found = np.stack(
        [_line(time, channel, moments, limit) for channel in flat.T], axis=1
    )
    return found.reshape(len(moments), *values.shape[1:])


def _line(
    time: np.ndarray, channel: np.ndarray, moments: np.ndarray, limit: float
) -> np.ndarray:
    seen = np.isfinite(channel)
    if not seen.any():
        return np.full(len(moments), np.nan)
    times = time[seen]
    found = np.interp(moments, times, channel[seen], left=np.nan, right=np.nan)
    after = np.searchsorted(times, moments).clip(0, len(times) - 1)
    before = (np.searchsorted(times, moments, side="right") - 1).clip(0)
    return np.where(times[after] - times[before] <= limit, found, np.nan)
