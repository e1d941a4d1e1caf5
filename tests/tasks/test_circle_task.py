import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.tasks import TASKS, Task, circle, load_task

TWIN = load_arm("twin_arm")


def tip_path(arm):
    return circle(arm).desired_positions()[:, -1]


def arc_angle(reach):
    """Bend f of an arm of 0.6 m with this reach: 0.6 (1 - cos f) / f, by bisection."""
    low, high = 1e-9, 2.0
    for _ in range(100):
        middle = (low + high) / 2
        short = 0.6 * (1 - np.cos(middle)) / middle < reach
        low, high = (middle, high) if short else (low, middle)
    return low


def arc_height(reach):
    angle = arc_angle(reach)
    return 0.6 * np.sin(angle) / angle


@pytest.mark.parametrize("step", [1, 2, 10, 39, 40])
def test_the_approach_follows_arcs_of_equal_bends_and_ends_at_the_height_of_the_circle(
    step,
):
    """The protocol's formula at full precision (0.5423, not 0.5416)."""
    share = step / 40
    height = arc_height(0.22 * share) + (0.54 - arc_height(0.22)) * share
    expected = [0.22 * share, 0.0, height]
    np.testing.assert_allclose(tip_path(TWIN)[step - 1], expected, atol=1e-6)


def test_the_approach_is_within_a_millimeter_of_the_protocol_as_printed():
    shares = np.arange(1, 41) / 40
    printed = [arc_height(0.22 * share) + (0.54 - 0.5416) * share for share in shares]
    np.testing.assert_allclose(tip_path(TWIN)[:40, 2], printed, atol=1e-3)


def test_the_round_goes_once_counterclockwise_at_one_radius_and_height():
    x, y, z = tip_path(TWIN)[39:].T
    turned = np.unwrap(np.arctan2(y, x))
    np.testing.assert_allclose(np.hypot(x, y), 0.22, atol=1e-6)
    np.testing.assert_allclose(z, 0.54, atol=1e-6)
    np.testing.assert_allclose(np.diff(turned), 2 * np.pi / 160, atol=1e-5)
    assert turned[-1] - turned[0] == pytest.approx(2 * np.pi, abs=1e-5)


def test_an_unknown_task_lists_the_known_ones():
    with pytest.raises(TargetError, match="no task 'triangle'") as caught:
        load_task("triangle", TWIN)
    assert all(name in str(caught.value) for name in TASKS)


@pytest.mark.parametrize("goals", [(), None, np.zeros((2, 3)), iter(()), "circle"])
def test_a_task_without_goals_is_rejected(goals):
    with pytest.raises(TargetError, match=r"(?s)no goals, got .*give a tuple of goals"):
        Task("nothing", goals)
