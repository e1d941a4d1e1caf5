"""Linear interpolation of columns in time.

Nothing is interpolated between neighbors that are further apart than a limit.
"""

import numpy as np


def evenly_spread(count: int, most: int) -> np.ndarray:
    """Indices of at most this many of `count` rows."""
    return np.linspace(0, count - 1, min(count, most)).astype(int)


def interpolate(
    time: np.ndarray, values: np.ndarray, samples: np.ndarray, limit: float
) -> np.ndarray:
    """Linear interpolation; NaN between neighbors further apart than a limit.

    Each channel has its own neighbors, so one missing channel does not hide the others.
    """
    channels = values.reshape(len(values), -1).T
    columns = [
        _interpolate_channel(time, channel, samples, limit) for channel in channels
    ]
    shape = len(samples), *values.shape[1:]
    return np.stack(columns, axis=1).reshape(shape)


def _interpolate_channel(
    time: np.ndarray, channel: np.ndarray, samples: np.ndarray, limit: float
) -> np.ndarray:
    known = np.isfinite(channel)
    if not known.any():
        return np.full(len(samples), np.nan)
    times = time[known]
    values = np.interp(samples, times, channel[known], left=np.nan, right=np.nan)
    return np.where(is_near(times, samples, limit), values, np.nan)


def is_near(times: np.ndarray, samples: np.ndarray, limit: float) -> np.ndarray:
    """Whether the neighbors of each sample are no further apart than a limit."""
    after = np.searchsorted(times, samples).clip(0, len(times) - 1)
    before = (np.searchsorted(times, samples, side="right") - 1).clip(0)
    return times[after] - times[before] <= limit
