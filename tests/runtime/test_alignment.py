"""Tracked states move to the times of the readings."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.runtime import StepRecord, build_episode
from s2c2a.runtime.alignment import MAX_GAP, align_states
from s2c2a.spaces import Reading, Stage

PERIOD = 0.05  # s
TIMES = np.arange(40) * PERIOD


def states_at(times):
    """One module whose end moves and turns evenly."""
    angle = 0.4 * times
    zeros = np.zeros_like(times)
    columns = [0.2 * times, zeros, zeros + 0.3, np.sin(angle), zeros, np.cos(angle)]
    return np.stack(columns, axis=-1)[:, None]


@pytest.mark.parametrize("latency", [0.0, 0.02, 0.08])
def test_late_frames_give_the_states_at_the_readings(latency):
    aligned = align_states(TIMES, states_at(TIMES - latency), np.full(40, latency))
    known = np.isfinite(aligned).all(axis=(1, 2))
    assert known.sum() >= 40 - np.ceil(latency / PERIOD)
    np.testing.assert_allclose(aligned[known], states_at(TIMES)[known], atol=1e-6)


def test_a_frame_that_is_read_twice_counts_once():
    exposures = np.floor(TIMES / 0.1) * 0.1 - 0.01
    aligned = align_states(TIMES, states_at(exposures), TIMES - exposures)
    known = np.isfinite(aligned).all(axis=(1, 2))
    assert known.sum() >= 37
    np.testing.assert_allclose(aligned[known], states_at(TIMES)[known], atol=1e-4)


def test_long_gaps_stay_missing_and_short_ones_are_filled():
    states = states_at(TIMES)
    states[10:12] = np.nan
    states[20:30] = np.nan
    aligned = align_states(TIMES, states, np.full(40, 0.01))
    known = np.isfinite(aligned).all(axis=(1, 2))
    assert known[10:12].all()
    assert not known[20:29].any()
    assert 10 * PERIOD > MAX_GAP


def test_without_frames_everything_is_missing():
    states = np.full((40, 1, 6), np.nan)
    assert np.isnan(align_states(TIMES, states, np.full(40, np.nan))).all()


def test_an_episode_has_aligned_states():
    arm = load_arm("twin_arm")
    late = np.repeat(states_at(TIMES - 0.02), 3, axis=1)
    steps = [
        StepRecord(
            number=number,
            moment=time,
            stage=Stage.RUN,
            reading=Reading(time, {"states": state, "states_age": np.asarray(0.02)}),
            goal=None,
            action=np.zeros((3, 3)),
        )
        for number, (time, state) in enumerate(zip(TIMES, late, strict=True))
    ]
    episode = build_episode(steps, arm)
    expected = states_at(TIMES)[5, 0]
    np.testing.assert_allclose(episode.sensor("states")[5, 1], expected, atol=1e-6)
