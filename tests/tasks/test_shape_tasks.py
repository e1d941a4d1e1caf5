"""Curves for the whole arm: what goals they make, and what is refused of them."""

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.tasks import Score, load_curve, load_task, load_waypoints, shape_task

TWIN = load_arm("twin_arm")


def arc(angle_deg, length=0.6, count=200):
    """Points of an arc in the x-z plane that leaves the base along z."""
    angles = np.linspace(0.0, np.deg2rad(angle_deg), count)
    radius = length / angles[-1]
    x, z = radius * (1 - np.cos(angles)), radius * np.sin(angles)
    return np.stack([x, np.zeros(count), z], axis=-1)


def test_ends_lie_on_an_arc_with_its_tangents():
    goal = shape_task("arc", arc(90), TWIN).goals[-1]
    angles = np.deg2rad([30, 60, 90])
    radius = 0.6 / angles[-1]
    sines, cosines, none = np.sin(angles), np.cos(angles), np.zeros(3)
    ends = radius * np.array([1 - cosines, none, sines]).T
    tangents = np.array([sines, none, cosines]).T
    np.testing.assert_allclose(goal.desired_positions(), ends, atol=1e-4)
    turned = np.arccos(np.vecdot(goal.desired_axes(), tangents).clip(-1, 1))
    assert np.rad2deg(turned).max() < 2.0  # a chord of 2 cm at the tip


def test_the_goal_is_the_same_for_as_long_as_a_hold_task_lasts():
    task = shape_task("arc", arc(90), TWIN)
    assert len(task.goals) == len(load_task("hold-end", TWIN).goals)
    np.testing.assert_array_equal(task.goals[0].positions, task.goals[-1].positions)
    assert task.scores == (Score("shape"), Score("end distance"))


def test_a_table_without_times_is_a_curve(tmp_path):
    path = tmp_path / "bow.csv"
    rows = [",".join(map(str, point)) for point in arc(90)]
    path.write_text("\n".join([" x , y, z", *rows]), encoding="utf-8")
    np.testing.assert_allclose(load_curve(path), arc(90))
    task = load_task(str(path), TWIN)
    assert (task.name, len(task.curve)) == ("bow", 200)
    with pytest.raises(TargetError, match="it needs time, x, y, z"):
        load_waypoints(path)


def test_a_longer_curve_is_followed_as_far_as_the_arm_goes():
    curve = np.concatenate([arc(90), [[2.0, 0.0, 0.38]]])
    long = shape_task("long", curve, TWIN).desired_positions()[0]
    plain = shape_task("arc", arc(90), TWIN).desired_positions()[0]
    np.testing.assert_allclose(long, plain, atol=1e-5)


def test_a_curve_that_is_a_little_short_is_followed_in_proportion():
    short = shape_task("short", arc(90, length=0.58), TWIN)
    tip = short.desired_positions()[0, -1]
    np.testing.assert_allclose(tip, arc(90, length=0.58)[-1], atol=1e-6)


EDGE = np.array([[0, 0, 0], [0, 0, 0.3], [0.4, 0, 0.3]])


@pytest.mark.parametrize(
    ("points", "told"),
    [
        (arc(90)[:2], "has 2 points; give at least three"),
        (1000 * arc(90), "write lengths in meters"),
        (np.full((3, 3), np.nan), "a coordinate of nan m"),
        (arc(90)[60:], "cm from the base; begin it at the base"),
        (arc(90)[::-1], "list its points from base to tip"),
        (arc(90, length=0.5), "is 0.5 m long, and 'twin_arm' 0.6 m"),
        (EDGE, "turns by 90 deg at 0,0,0.3"),
        (arc(90)[:, [2, 1, 0]], "turns by 8. deg at 0,0,0, .* begin along z"),
    ],
)
def test_what_no_arm_can_take_is_refused_with_the_way_out(points, told):
    with pytest.raises(TargetError, match=told):
        shape_task("mine", points, TWIN)
