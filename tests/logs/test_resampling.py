"""Segments: gaps end episodes and are never interpolated."""

import numpy as np
import pytest

from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import Rows
from s2c2a.logs.resampling import split_segments
from s2c2a.logs.take import LogTake


def take(time, commanded=None, x=None, labels=None) -> LogTake:
    rows = len(time)
    commanded = np.asarray(time if commanded is None else commanded, float)[:, None]
    positions = np.zeros((rows, 1, 3))
    positions[:, 0, 0] = time if x is None else x
    nothing = np.full((rows, 1), np.nan)
    labels = np.full(rows, "") if labels is None else np.array(labels, object)
    return LogTake(
        np.asarray(time, float),
        commanded,
        nothing,
        positions,
        np.full((rows, 1, 3), np.nan),
        labels,
    )


TIMED = Rows(kind="timed", time="t", shortest=2)
STEPS = Rows(kind="steps", shortest=2)


def test_irregular_times_and_short_gaps_of_positions_are_resampled_linearly():
    random = np.random.default_rng(0)
    time = np.sort(random.uniform(0, 3, 300))
    x = time.copy()
    x[10:12] = np.nan
    (segment,) = split_segments(take(time, x=x), TIMED, 0.1)
    np.testing.assert_allclose(np.diff(segment.time), 0.1)
    np.testing.assert_allclose(segment.commanded[:, 0], segment.time, atol=1e-12)
    np.testing.assert_allclose(segment.positions[:, 0, 0], segment.time, atol=1e-12)


def test_a_gap_separates_episodes_and_is_in_none():
    time = np.concatenate([np.arange(0, 1, 0.05), np.arange(2, 3, 0.05)])
    first, second = split_segments(take(time), TIMED, 0.1)
    assert first.time[-1] <= 0.95
    assert second.time[0] >= 2


def test_unknown_commands_separate_episodes_and_missing_positions_stay_nan():
    time = np.arange(0, 2, 0.1)
    commands = time.copy()
    x = time.copy()
    commands[10] = np.nan
    x[3:9] = np.nan
    first, second = split_segments(take(time, commands, x), TIMED, 0.1)
    assert len(first) == 10
    assert len(second) == 9
    assert np.isnan(first.positions[3:9, 0, 0]).all()
    assert np.isfinite(first.commanded).all()


def test_steps_are_not_resampled_and_labels_separate_them():
    time = [0.0, 0.6, 5.0, 5.6, 6.0, 30.0]
    parts = split_segments(take(time, labels=[*"aaabbb"]), STEPS, 0.5)
    assert [list(part.time) for part in parts] == [[0.0, 0.6, 5.0], [5.6, 6.0, 30.0]]
    stated = Rows(kind="steps", shortest=2, longest_gap=10.0)
    assert [len(part) for part in split_segments(take(time), stated, 0.5)] == [5]


def test_short_segments_are_dropped_and_of_equal_times_the_first_counts():
    longer = Rows(kind="steps", shortest=4)
    assert split_segments(take([0.0, 1.0, 2.0]), longer, 1.0) == []
    (segment,) = split_segments(take([0.0, 1.0, 1.0, 2.0], x=[0, 1, 9, 2]), STEPS, 1.0)
    np.testing.assert_array_equal(segment.positions[:, 0, 0], [0, 1, 2])


def test_decreasing_times_are_an_error():
    with pytest.raises(LogError, match="fall"):
        split_segments(take([0.0, 1.0, 0.5, 2.0]), STEPS, 1.0)


@pytest.mark.parametrize(
    ("interval", "text"),
    [
        (100.0, "100 s apart, 1000 control periods"),  # milliseconds as seconds
        (6.0, "6 s apart, 60 control periods"),  # seconds as minutes
        (1e-4, "0.0001 s apart"),  # seconds as milliseconds
    ],
)
def test_rates_of_rows_that_no_log_has_name_the_unit(interval, text):
    with pytest.raises(LogError, match=f"{text}.*correct rows.unit"):
        split_segments(take(interval * np.arange(50)), TIMED, 0.1)
