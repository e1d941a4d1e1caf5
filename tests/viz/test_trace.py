import numpy as np
import pytest

from s2c2a.errors import S2C2AError
from s2c2a.viz import Trace
from s2c2a.viz.trace import check_same_arm


@pytest.mark.parametrize(
    ("name", "shape", "expected"),
    [
        ("times", (5, 1), r"expected \(time,\)"),
        ("times", (0,), "at least one step"),
        ("states", (199, 3, 6), r"states has shape \(199, 3, 6\), expected \(200, modules, 6\)"),
        ("states", (200, 3, 3), r"expected \(200, modules, 6\)"),
        ("states", (200, 6), r"expected \(200, modules, 6\)"),
        ("states", (200, 0, 6), "at least one module"),
        ("wanted_positions", (200, 2, 3), r"expected \(200, 3, 3\)"),
        ("wanted_axes", (200, 3), r"expected \(200, 3, 3\)"),
        ("obstacles", (200, 1, 3), r"expected \(200, obstacles, 4\)"),
    ],
)
def test_a_trace_refuses_a_wrong_shape_and_says_what_it_expected(make_trace, name, shape, expected):
    with pytest.raises(S2C2AError, match=expected):
        make_trace(**{name: np.zeros(shape)})


def test_a_trace_refuses_times_that_do_not_rise(make_trace):
    with pytest.raises(S2C2AError, match="rise"):
        make_trace(times=np.zeros(200))


def test_a_trace_refuses_what_is_not_numbers(make_trace):
    with pytest.raises(S2C2AError, match="not an array of numbers"):
        make_trace(times=["now"] * 200)


def test_a_trace_keeps_a_copy_that_nobody_can_change(make_trace):
    times = np.arange(200.0)
    trace = make_trace(times=times)
    times[0] = -1.0
    assert trace.times[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        trace.times[0] = 5.0


def test_targets_may_be_nan_and_so_is_the_error_there(make_trace):
    wanted = np.full((200, 3, 3), np.nan)
    wanted[:10, 1] = 0.1
    trace = make_trace(wanted_positions=wanted)
    assert trace.followed_module == 1
    assert np.isfinite(trace.position_errors[:10]).all()
    assert np.isnan(trace.position_errors[10:]).all()


def test_errors_are_distance_and_angle_from_what_is_wanted():
    state = np.array([[[0.0, 0.0, 0.2, 0.0, 0.0, 1.0]]])
    trace = Trace("one", [0.0], state, [[[0.03, 0.04, 0.2]]], [[[1.0, 0.0, 0.0]]], np.zeros((1, 0, 4)))
    np.testing.assert_allclose(trace.position_errors, [0.05])
    np.testing.assert_allclose(trace.axis_errors, [np.pi / 2])


def test_the_mean_is_over_the_steps_that_count(make_trace):
    errors = make_trace().position_errors
    counted = np.arange(200) < 50
    trace = make_trace(counted=counted)
    np.testing.assert_array_equal(trace.position_errors, errors)
    np.testing.assert_array_equal(trace.counted_errors, errors[:50])
    assert len(make_trace().counted_errors) == 200
    with pytest.raises(S2C2AError, match="counted has shape"):
        make_trace(counted=counted[:-1])
    with pytest.raises(S2C2AError, match="truths"):
        make_trace(counted=np.full(200, np.nan))


def test_steps_that_do_not_count_lie_in_spans_half_a_step_wider(make_trace):
    counted = np.ones(200, bool)
    counted[[0, 50, 51, 70, 199]] = False
    spans = make_trace(counted=counted).uncounted_spans
    np.testing.assert_allclose(spans, [(0.0, 0.05), (4.95, 5.15), (6.95, 7.05), (19.85, 19.9)])
    assert make_trace().uncounted_spans == []


def test_a_trace_without_a_target_follows_the_last_module(make_trace):
    trace = Trace.without_target("recorded", np.arange(200.0), make_trace().states)
    assert trace.followed_module == 2
    assert np.isnan(trace.position_errors).all()


def test_the_pointing_module_is_the_outermost_whose_axis_is_asked_for(make_trace):
    wanted = np.full((200, 3, 3), np.nan)
    assert make_trace(wanted_axes=wanted).pointing_module == 2
    wanted[5:, :2] = [0.0, 0.0, 1.0]
    assert make_trace(wanted_axes=wanted).pointing_module == 1


def test_traces_of_another_arm_or_none_at_all_are_refused(make_arm, make_trace):
    with pytest.raises(S2C2AError, match="3 modules and arm 'test_arm' has 4"):
        check_same_arm([make_trace()], make_arm(4))
    with pytest.raises(S2C2AError, match="no trace"):
        check_same_arm([], make_arm())
