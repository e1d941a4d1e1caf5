"""Invalid or extreme numbers: accepted and bounded, or rejected with an error."""

import contextlib

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions
from s2c2a.errors import RecordingError, S2C2AError, TargetError
from s2c2a.files.text import MAX_COUNT
from s2c2a.goals import Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime.stages import Patience
from s2c2a.tasks import Waypoints, waypoints_task

TWIN = load_arm("twin_arm")
NUMBERS = (
    st.floats()
    | st.integers()
    | st.sampled_from([10**400, -(10**400), 1e308, 2**63, True])
)
VECTORS = st.lists(NUMBERS, max_size=4) | NUMBERS | st.none() | st.text(max_size=3)


def is_bounded(goal: Goal) -> bool:
    """Whether all numbers are small; goals that nobody has told are NaN."""
    known = goal._asdict()
    assert np.isnan(known.pop("preview")).all()
    return all((np.abs(part) <= 1e6).all() for part in known.values())


@given(NUMBERS, NUMBERS, NUMBERS)
@example(float("nan"), 1, 0)
@example(1, float("inf"), 0)
@example(1, 1, float("nan"))
def test_collect_options_are_bounded_integers_or_rejected(episodes, samples, seed):
    with contextlib.suppress(RecordingError):
        options = CollectOptions(episodes=episodes, samples=samples, seed=seed)
        assert 1 <= options.episodes <= MAX_COUNT
        assert 1 <= options.samples <= MAX_COUNT
        assert options.seed % 1 == 0


@given(NUMBERS, NUMBERS)
def test_speeds_increase_below_the_full_bend_or_are_rejected(slowest, fastest):
    with contextlib.suppress(RecordingError):
        assert 0 < CollectOptions(speeds=(slowest, fastest)).speeds[0] <= 1


@given(VECTORS, VECTORS, st.integers() | st.floats())
@example([0.1, 0.0, 0.5], 1.0, -1)
@example([1e308, 0, 0], 1.0, -1)
@example([10**400, 0, 0], 1.0, -1)
@example([0, 0, 1], 10**5000, -1)
def test_goals_are_finite_and_bounded_or_rejected(vector, weight, module):
    for change in (Goal.with_position, Goal.with_axis):
        with contextlib.suppress(TargetError):
            goal = change(Goal.of(3), vector, weight, module)
            assert is_bounded(goal)


@given(st.lists(VECTORS, max_size=3), VECTORS, VECTORS)
@example([], [], 0.0)
@example([[0.1, 0.0, 0.5]], [0.05], 1.0)
def test_obstacles_are_finite_and_bounded_or_rejected(centers, thresholds, weight):
    with contextlib.suppress(TargetError):
        goal = Goal.of(3).with_obstacles(centers, thresholds, weight)
        assert is_bounded(goal)


@given(
    st.lists(st.floats(), min_size=1, max_size=4),
    st.floats(),
    st.floats(),
    st.integers(),
)
@example([1.0], 1e308, 1.0, -1)
@example([1.0], 1e30, 0.0, -1)
@example([float("nan")], 0.0, 1.0, -1)
def test_waypoints_make_finite_goals_or_are_rejected(times, position, axis, module):
    positions, axes = ([[value] * 3] * len(times) for value in (position, axis))
    track = Waypoints(module, *map(np.array, (times, positions, axes)))
    slow = TWIN.model_copy(update={"control_rate": 0.5})
    with contextlib.suppress(TargetError):
        task = waypoints_task("mine", [track], slow)
        assert is_bounded(task.goals[0])
        assert is_bounded(task.goals[-1])


@given(NUMBERS, NUMBERS)
def test_patience_is_a_number_of_steps_or_rejected(unsound, alone):
    with contextlib.suppress(S2C2AError):
        assert Patience.of(10.0, unsound, alone).alone >= 1


@pytest.mark.parametrize(
    "bad",
    [
        {"payload": float("nan")},
        {"payload": -1.0},
        {"payload": 1e308},
        {"seed": -1},
        {"jitter": float("nan")},
        {"jitter": -0.5},
        {"fidelity": "perfect"},
    ],
)
def test_a_simulated_arm_with_invalid_options_is_rejected(bad):
    with pytest.raises(S2C2AError):
        SimulatedRobot(TWIN, **bad)
