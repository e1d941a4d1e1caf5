"""Whatever a client sends, a request stays within its limits."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from s2c2a.live.goals import goal_of
from s2c2a.live.request import MAX_OBSTACLES, Obstacle, Request, RequestLimits

LIMITS = RequestLimits(reach=1.2, payload=0.24, push=2.0, noise=0.1, tasks=("circle",))
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
    "task",
    "speed",
    "obstacles",
    "weights",
    "payload",
    "push",
    "coupling",
    "noise",
)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(st.sampled_from(NAMES), ANYTHING))
def test_no_value_leads_out_of_the_limits(changes):
    request = LIMITS.changed(Request(), **changes)
    assert (
        request.target is None or np.linalg.norm(request.target) <= LIMITS.reach + 1e-9
    )
    assert request.axis is None or np.linalg.norm(request.axis) == pytest.approx(1.0)
    assert request.task in (None, "circle")
    assert 0 <= request.payload <= LIMITS.payload
    assert np.abs(request.push).max() <= LIMITS.push
    assert 0 <= request.coupling <= 1
    assert 0 <= request.noise <= LIMITS.noise
    goal_of(request, 3, None)  # refuses what is not finite


def test_a_target_too_far_is_drawn_to_the_limit_and_nonsense_is_passed_over():
    request = LIMITS.changed(Request(), target=(0, 0, 5))
    assert request.target == pytest.approx((0, 0, 1.2))
    for nonsense in (
        (0, 0),
        "abc",
        (float("nan"), 0, 0),
        (float("inf"), 0, 0),
        [[1, 2, 3]],
        {"x": 1},
    ):
        assert LIMITS.changed(request, target=nonsense) == request
    assert LIMITS.changed(request, no_such_thing=1, speed=2.0) == LIMITS.changed(
        request, speed=2.0
    )


def test_obstacles_are_few_and_of_sound_size():
    many = tuple(Obstacle((9.0, 0.0, 0.0), 7.0) for _ in range(30))
    own = LIMITS.changed(Request(), obstacles=many).obstacles
    assert len(own) == MAX_OBSTACLES
    assert own[0].center == pytest.approx((1.2, 0, 0))
    assert own[0].threshold == pytest.approx(0.3)
