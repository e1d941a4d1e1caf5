"""Gaps end episodes; nothing is filled in across one."""

import numpy as np
import pytest

from s2c2a.logs.errors import LogError
from s2c2a.logs.map import Rows
from s2c2a.logs.resampling import stretches
from s2c2a.logs.session import Session


def session(time, commanded=None, x=None, labels=None) -> Session:
    rows = len(time)
    commanded = np.asarray(time if commanded is None else commanded, float)[:, None]
    positions = np.zeros((rows, 1, 3))
    positions[:, 0, 0] = time if x is None else x
    nothing = np.full((rows, 1), np.nan)
    labels = np.full(rows, "") if labels is None else np.array(labels, object)
    return Session(
        np.asarray(time, float),
        commanded,
        nothing,
        positions,
        np.full((rows, 1, 3), np.nan),
        labels,
    )


TIMED = Rows(kind="timed", time="t", shortest=2)
STEPS = Rows(kind="steps", shortest=2)


def test_irregular_times_become_regular_ones_on_straight_lines():
    random = np.random.default_rng(0)
    time = np.sort(random.uniform(0, 3, 300))
    (part,) = stretches(session(time), TIMED, 0.1)
    np.testing.assert_allclose(np.diff(part.time), 0.1)
    np.testing.assert_allclose(part.commanded[:, 0], part.time, atol=1e-12)
    np.testing.assert_allclose(part.positions[:, 0, 0], part.time, atol=1e-12)


def test_a_gap_parts_episodes_and_lies_in_none():
    time = np.concatenate([np.arange(0, 1, 0.05), np.arange(2, 3, 0.05)])
    first, second = stretches(session(time), TIMED, 0.1)
    assert first.time[-1] <= 0.95
    assert second.time[0] >= 2


def test_unknown_commands_part_episodes_and_unknown_truth_stays_unknown():
    time = np.arange(0, 2, 0.1)
    commands, x = time.copy(), time.copy()
    commands[10] = np.nan
    x[3:9] = np.nan
    first, second = stretches(session(time, commands, x), TIMED, 0.1)
    assert len(first) == 10
    assert len(second) == 9
    assert np.isnan(first.positions[3:9, 0, 0]).all()
    assert np.isfinite(first.commanded).all()


def test_truth_is_interpolated_over_a_short_blank_alone():
    time = np.arange(0, 1, 0.02)
    x = time.copy()
    x[10:12] = np.nan
    (part,) = stretches(session(time, x=x), TIMED, 0.1)
    np.testing.assert_allclose(part.positions[:, 0, 0], part.time, atol=1e-12)


def test_steps_are_rows_whatever_their_times_and_labels_part_them():
    time = [0.0, 0.6, 5.0, 5.6, 6.0, 30.0]
    parts = stretches(session(time, labels=["a", "a", "a", "b", "b", "b"]), STEPS, 0.5)
    assert [list(part.time) for part in parts] == [[0.0, 0.6, 5.0], [5.6, 6.0, 30.0]]
    stated = Rows(kind="steps", shortest=2, longest_gap=10.0)
    assert [len(part) for part in stretches(session(time), stated, 0.5)] == [5]


def test_short_stretches_are_left_out_and_doubled_moments_count_once():
    assert (
        stretches(session([0.0, 1.0, 2.0]), Rows(kind="steps", shortest=4), 1.0) == []
    )
    (part,) = stretches(session([0.0, 1.0, 1.0, 2.0], x=[0, 1, 9, 2]), STEPS, 1.0)
    np.testing.assert_array_equal(part.positions[:, 0, 0], [0, 1, 2])


def test_a_clock_that_was_set_back_is_told():
    with pytest.raises(LogError, match="fall"):
        stretches(session([0.0, 1.0, 0.5, 2.0]), STEPS, 1.0)
