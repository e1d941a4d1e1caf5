"""Requests stay within their limits, whatever a client sends."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from s2c2a.live.goals import goal_of
from s2c2a.live.request import MAX_OBSTACLES, Obstacle, Request, RequestLimits
from s2c2a.live.scene_files import solid_of
from s2c2a.tasks.scenes import HalfSpace

LIMITS = RequestLimits(
    reach=1.2, payload=0.24, force=2.0, noise=0.1, tasks=("circle",), modules=3
)
ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.binary(),
    st.lists(st.floats(), max_size=4),
)
NAMES = (
    "target",
    "axis",
    "shape",
    "task",
    "speed",
    "obstacles",
    "weights",
    "payload",
    "force",
    "coupling",
    "noise",
)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from(NAMES), ANYTHING))
def test_no_value_exceeds_the_limits(changes):
    request = LIMITS.changed(Request(), **changes)
    assert (
        request.target is None or np.linalg.norm(request.target) <= LIMITS.reach + 1e-9
    )
    assert request.axis is None or np.linalg.norm(request.axis) == pytest.approx(1.0)
    assert request.task in (None, "circle")
    assert 0 <= request.payload <= LIMITS.payload
    assert np.abs(request.force).max() <= LIMITS.force
    assert 0 <= request.coupling <= 1
    assert 0 <= request.noise <= LIMITS.noise
    goal_of(request, 3, None)  # raises for values that are not finite


def test_a_far_target_is_projected_to_the_limit_and_invalid_values_are_ignored():
    request = LIMITS.changed(Request(), target=(0, 0, 5))
    assert request.target == pytest.approx((0, 0, 1.2))
    for invalid in (
        (0, 0),
        "abc",
        (float("nan"), 0, 0),
        (float("inf"), 0, 0),
        [[1, 2, 3]],
        {"x": 1},
    ):
        assert LIMITS.changed(request, target=invalid) == request
    assert LIMITS.changed(request, no_such_thing=1, speed=2.0) == LIMITS.changed(
        request, speed=2.0
    )


def test_the_number_and_size_of_obstacles_are_limited():
    many = tuple(Obstacle((9.0, 0.0, 0.0), 7.0) for _ in range(30))
    obstacles = LIMITS.changed(Request(), obstacles=many).obstacles
    assert len(obstacles) == MAX_OBSTACLES
    assert obstacles[0].center == pytest.approx((1.2, 0, 0))
    assert obstacles[0].threshold == pytest.approx(0.3)


def test_a_wall_is_moved_by_a_point_of_its_surface_and_stays_within_reach():
    wall = HalfSpace(point=(0.0, -0.3, 0.0), normal=(0.0, 1.0, 0.0))
    obstacle = Obstacle.of(wall.rows()[0])
    np.testing.assert_allclose(obstacle.place, [0.0, -0.3, 0.0], atol=1e-9)
    request = LIMITS.changed(Request(), obstacles=(obstacle.at((0.0, -9.0, 0.0)),))
    (kept,) = request.obstacles
    np.testing.assert_allclose(kept.place, [0.0, -LIMITS.reach, 0.0], atol=1e-9)
    assert solid_of(kept.row).kind == "half_space"
