import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.errors import TargetError
from s2c2a.goals import MAX_OBSTACLES
from s2c2a.planning import Goal

SHAPES = r"give \(n, 3\) centers"


def test_a_new_goal_has_only_a_cost_of_change():
    goal = Goal.of(3, change_weight=0.7)
    assert not goal.position_weights.any()
    assert not goal.axis_weights.any()
    assert not goal.thresholds.any()
    assert goal.change_weight == np.float32(0.7)


@pytest.mark.parametrize("modules", [load_arm("twin_arm"), 3.0, "3", 0, -1, None])
def test_a_goal_for_no_number_of_modules_is_refused(modules):
    with pytest.raises(TargetError, match=r"got .*; write Goal\.of\(arm\.module_count"):
        Goal.of(modules)


def test_a_position_applies_to_the_tip_unless_a_module_is_given():
    goal = (
        Goal.of(3)
        .with_position([0.1, 0.2, 0.5])
        .with_position([0.0, 0.0, 0.2], weight=4.0, module=0)
    )
    np.testing.assert_allclose(
        goal.positions, [[0, 0, 0.2], [0, 0, 0], [0.1, 0.2, 0.5]], rtol=1e-6
    )
    np.testing.assert_array_equal(goal.position_weights, [4, 0, 1])


def test_an_axis_of_any_length_becomes_a_direction():
    goal = Goal.of(2).with_axis([0.0, 3.0, 4.0], weight=1.5)
    np.testing.assert_allclose(goal.axes, [[0, 0, 1], [0, 0.6, 0.8]], rtol=1e-6)
    np.testing.assert_array_equal(goal.axis_weights, [0, 1.5])


def test_obstacles_fill_the_first_rows_and_replace_earlier_ones():
    goal = (
        Goal.of(3)
        .with_obstacles(np.ones((3, 3)), [0.1, 0.2, 0.3])
        .with_obstacles([[0.1, 0.2, 0.3]], [0.05], 2.0)
    )
    np.testing.assert_allclose(goal.obstacles[0], [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(
        goal.thresholds, [0.05] + [0] * (MAX_OBSTACLES - 1), rtol=1e-6
    )
    assert goal.obstacle_weight == 2.0


def test_changing_a_goal_leaves_the_old_one_as_it_was():
    goal = Goal.of(3)
    goal.with_position([1, 2, 3]).with_axis([1, 0, 0]).with_obstacles(
        [[1, 1, 1]], [0.1]
    )
    assert not goal.positions.any()
    assert not goal.thresholds.any()
    np.testing.assert_array_equal(goal.axes, np.tile([0, 0, 1], (3, 1)))


def test_goals_of_one_arm_never_change_their_shapes_or_types():
    plain = Goal.of(3)
    full = plain.with_position([1, 2, 3], 2).with_axis((0, 1, 0), 1)
    full = full.with_obstacles([[1, 1, 1]] * MAX_OBSTACLES, [1] * MAX_OBSTACLES, 3)
    for before, after in zip(
        map(np.asarray, plain), map(np.asarray, full), strict=True
    ):
        assert (before.shape, before.dtype) == (after.shape, after.dtype)


@pytest.mark.parametrize("empty", [[], np.zeros((0, 3))])
def test_obstacles_can_be_removed(empty):
    goal = Goal.of(3).with_obstacles([[0, 0, 0.5]], [0.1]).with_obstacles(empty, [])
    assert not goal.thresholds.any()


@pytest.mark.parametrize("module", [3, -4, 100])
def test_a_module_that_the_arm_lacks_is_refused(module):
    with pytest.raises(TargetError, match=f"no module {module}; this goal is for 3"):
        Goal.of(3).with_position([0, 0, 0.5], module=module)
    with pytest.raises(TargetError, match=f"no module {module}; this goal is for 3"):
        Goal.of(3).with_axis([0, 0, 1], module=module)


@pytest.mark.parametrize("weight", [-1.0, np.nan, np.inf, [1.0, 2.0], "heavy"])
def test_a_weight_that_is_no_finite_number_from_zero_up_is_refused(weight):
    with pytest.raises(TargetError, match="weight must be"):
        Goal.of(3, change_weight=weight)
    with pytest.raises(TargetError, match="weight must be"):
        Goal.of(3).with_position([0, 0, 0.5], weight)
    with pytest.raises(TargetError, match="weight must be"):
        Goal.of(3).with_axis([0, 0, 1], weight)
    with pytest.raises(TargetError, match="weight must be"):
        Goal.of(3).with_obstacles([[0, 0, 0.5]], [0.1], weight)


@pytest.mark.parametrize(
    "bad",
    [
        [np.nan, 0, 0],
        [0, np.inf, 0],
        [0, 0],
        [0, 0, 0, 0],
        0.5,
        [[0, 0, 0]],
        "abc",
        None,
        [[1], [1, 2]],
    ],
)
def test_a_target_that_is_not_three_finite_numbers_is_refused(bad):
    message = "must be three finite numbers"
    with pytest.raises(TargetError, match=f"target position {message}"):
        Goal.of(3).with_position(bad)
    with pytest.raises(TargetError, match=f"target axis {message}"):
        Goal.of(3).with_axis(bad)


def test_an_axis_of_no_length_is_refused():
    with pytest.raises(TargetError, match="target axis is zero"):
        Goal.of(3).with_axis([0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("centers", "thresholds", "message"),
    [
        ([[0, 0, 1]], [0.1, 0.2], SHAPES),
        ([[0, 0]], [0.1], SHAPES),
        ([0, 0, 1], [0.1], SHAPES),
        ([[0, 0, 1]], 0.1, SHAPES),
        (np.zeros((65, 3)), np.ones(65), "n at most 64"),
        ([[0, 0, 0.5]], [-0.1], "must not be negative"),
        ([[0, 0, np.nan]], [0.1], "must be finite"),
        ([[0, 0, 1]], [np.inf], "must be finite"),
    ],
)
def test_obstacles_that_no_goal_can_have_are_refused(centers, thresholds, message):
    with pytest.raises(TargetError, match=message):
        Goal.of(3).with_obstacles(centers, thresholds)
