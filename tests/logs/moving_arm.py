"""Drives and tip of an arm with backlash and lag, each by its own clock."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

from s2c2a.kinematics import states_from_bends
from s2c2a.logs.timed_motion import TimedMotion

STEP = 0.002  # s
LAG = 0.06  # s
BACKLASH = 0.025  # rad
LENGTHS = np.array([0.25, 0.25])  # m
DIRECTIONS = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])


class TwoClocks(NamedTuple):
    """TimedMotion of drives and tip, and the drives' time of each row of the tip."""

    drives: TimedMotion
    tip: TimedMotion
    truth: np.ndarray


def two_clocks(
    seed,
    offset=0.37,
    drift=50e-6,
    span=100.0,
    poses=None,
    lag=LAG,
    backlash=BACKLASH,
) -> TwoClocks:
    """Drives at 10 Hz and a tip at 25 Hz, with noise; `poses` are repeated bends."""
    random = np.random.default_rng(seed)
    time = np.arange(-2.0, span + 4.0, STEP)
    knots = np.arange(-3.0, span + 6.0)
    targets = random.uniform(-0.6, 0.6, (len(knots), 4))
    if poses is not None:
        targets = targets[np.arange(len(knots)) % poses]
    bends = PchipInterpolator(knots, targets)(time)
    inner, outer = bends[:, :2] @ DIRECTIONS.T, bends[:, 2:] @ DIRECTIONS.T
    cables = 0.02 * np.concatenate([inner, outer], axis=1)
    states = states_from_bends(
        _followed(bends, lag, backlash).reshape(-1, 2, 2), LENGTHS
    )
    drive_time = np.arange(0.0, span, 0.1)
    drive_time += random.normal(0.0, 0.001, len(drive_time))
    drives = _sample(time, cables, drive_time)
    drives += random.normal(0.0, 3e-5, drives.shape)
    truth = np.arange(0.5, span + 1, 0.04)
    tip = _sample(time, np.asarray(states)[:, -1, :3], truth)
    tip += random.normal(0.0, 2e-4, tip.shape)
    own = (truth - offset) / (1 + drift)
    return TwoClocks(TimedMotion(drive_time, drives), TimedMotion(own, tip), truth)


def _followed(bends, lag, backlash):
    """Bends after backlash and a first-order lag."""
    state = bends[0]
    played = np.empty_like(bends)
    for row, bend in enumerate(bends):
        state = np.clip(state, bend - backlash, bend + backlash)
        played[row] = state
    decay = np.exp(-STEP / lag)
    start = decay * played[:1]
    return lfilter([1 - decay], [1, -decay], played, axis=0, zi=start)[0]


def _sample(time, values, samples):
    return np.stack([np.interp(samples, time, channel) for channel in values.T], 1)
