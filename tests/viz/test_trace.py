from dataclasses import replace

import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.viz import Trace


def test_an_episode_without_true_states_or_a_run_is_refused(make_trace, drawn):
    episode = make_trace().episode
    unseen = {
        name: values
        for name, values in episode.columns.items()
        if name != "sensor.states"
    }
    with pytest.raises(S2C2AError, match="'pcc' has no true states"):
        Trace(replace(episode, columns=unseen), "pcc")
    never_driven = {**episode.columns, "stage": np.zeros(len(episode), int)}
    with pytest.raises(S2C2AError, match="nothing to draw"):
        Trace(replace(episode, columns=never_driven), "pcc")


def test_the_error_is_nan_where_the_target_is_nan(make_trace):
    desired = np.full((200, 3, 3), np.nan)
    desired[:10, 1] = 0.1
    trace = make_trace(desired_positions=desired)
    assert trace.followed_module == 1
    assert np.isfinite(trace.position_errors[:10]).all()
    assert np.isnan(trace.position_errors[10:]).all()


def test_errors_are_distance_and_angle_from_what_is_desired(drawn):
    goals = {
        "desired_positions": [[[0.03, 0.04, 0.2]]],
        "desired_axes": [[[1.0, 0.0, 0.0]]],
    }
    trace = drawn("one", [0.0], [[[0.0, 0.0, 0.2, 0.0, 0.0, 1.0]]], **goals)
    np.testing.assert_allclose(trace.position_errors, [0.05])
    np.testing.assert_allclose(trace.axis_errors, [np.pi / 2])


def test_the_mean_error_is_over_the_counted_steps(make_trace):
    errors = make_trace().position_errors
    counted = np.arange(200) < 50
    trace = make_trace(counted=counted)
    np.testing.assert_array_equal(trace.position_errors, errors)
    np.testing.assert_array_equal(trace.counted_errors, errors[:50])
    assert len(make_trace().counted_errors) == 200


def test_uncounted_spans_are_wider_by_half_a_step(make_trace):
    counted = np.ones(200, bool)
    counted[[0, 50, 51, 70, 199]] = False
    spans = make_trace(counted=counted).uncounted_spans
    np.testing.assert_allclose(
        spans, [(0.0, 0.05), (4.95, 5.15), (6.95, 7.05), (19.85, 19.9)]
    )
    assert make_trace().uncounted_spans == []


def test_a_trace_without_a_target_follows_the_last_module(make_trace, drawn):
    trace = drawn("recorded", np.arange(200.0), make_trace().states)
    assert trace.followed_module == 2
    assert np.isnan(trace.position_errors).all()


def test_the_pointing_module_is_the_outermost_with_a_desired_axis(make_trace):
    desired = np.full((200, 3, 3), np.nan)
    assert make_trace(desired_axes=desired).pointing_module == 2
    desired[5:, :2] = [0.0, 0.0, 1.0]
    assert make_trace(desired_axes=desired).pointing_module == 1


def test_obstacles_that_appear_later_or_move_are_drawn_with_their_time(make_trace):
    steps = len(make_trace().times)
    obstacles = np.full((steps, 3, 4), np.nan)
    obstacles[:, 0] = [0.1, 0.0, 0.3, 0.05]
    obstacles[5:, 1] = [0.2, 0.0, 0.3, 0.05]
    obstacles[:, 2] = [0.3, 0.0, 0.3, 0.05]
    obstacles[-1, 2, 0] = 0.4
    trace = make_trace(obstacles=obstacles)
    drawn = [(float(sphere[0]), note) for sphere, note in trace.drawn_obstacles()]
    end = f"at {trace.times[-1]:.1f} s"
    assert drawn == [(0.1, ""), (0.2, "from 0.5 s"), (0.3, ""), (0.4, end)]
