"""True reach: resting shapes match the simulation, searches find reachable goals."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, Cable, load_arm, randomized_arm
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.jobs import Cache, made
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import AXIS, POSITION
from s2c2a.tasks import load_task
from s2c2a_experiments import true_reach
from s2c2a_experiments.targets import TOLERANCE, RandomTargets, ReachableTask
from s2c2a_experiments.true_reach import TrueReach, usable_range

TWIN = load_arm("twin_arm")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Use fewer samples."""
    monkeypatch.setattr(true_reach, "SAMPLES", 256)


@pytest.fixture(scope="module")
def mismatched():
    """An arm with every mismatch."""
    return randomized_arm(TWIN, 3, 1.0)


@pytest.fixture(scope="module")
def reach(mismatched):
    """A search on it."""
    return TrueReach(mismatched)


def without_memory(arm):
    """The arm without backlash, friction, creep and homing error."""
    lasting = []
    for module in arm.modules:
        cable = module.cable.model_copy(update={"backlash": 0.0, "friction": 0.0})
        mismatch = module.mismatch.model_copy(update={"relaxing": (0.0, 0.0)})
        changes = {"cable": cable, "mismatch": mismatch}
        lasting.append(module.model_copy(update=changes))
    motor = arm.motor.model_copy(update={"homing_error": 0.0})
    return arm.model_copy(update={"modules": tuple(lasting), "motor": motor})


def test_resting_shapes_match_the_aged_and_settled_simulated_arm(mismatched, reach):
    actions = reach.random_actions(3, np.random.default_rng(1))
    robot = SimulatedRobot(without_memory(mismatched), aged=1.0)
    for one, states in zip(actions, reach.states(actions), strict=True):
        robot.open()
        for _ in range(100):
            robot.step(ArmGeometry.of(mismatched).actions_at(one))
        np.testing.assert_allclose(robot.states(), states, atol=2e-4)


def test_position_and_axis_are_reached_together(reach):
    asked = reach.states(reach.random_actions(1, np.random.default_rng(8)))[0]
    goal = (
        Goal.of(3)
        .with_position(asked[1, POSITION], module=1)
        .with_axis(asked[1, AXIS], module=1)
    )
    found = reach.nearest(goal).states
    assert np.linalg.norm(found[1, POSITION] - asked[1, POSITION]) < TOLERANCE
    assert found[1, AXIS] @ asked[1, AXIS] > np.cos(np.deg2rad(2.0))


def test_backlash_homing_errors_and_friction_reduce_the_usable_range(make_arm):
    """One module: 22 mm at full bend of 0.8 rad, T = EI b / (L r)."""
    full, friction = 0.027 * np.deg2rad(47.0), 0.1
    cable = Cable(
        backlash=(1e-3, 2e-3, 0.0),
        friction=friction,
        friction_angle_deg=90.0,
        stiffness=3000.0,
    )
    arm = make_arm(
        modules=1,
        module={"cable": cable, "bend_limit_deg": 47.0},
        motor={"homing_error": 0.5e-3},
    )
    pull = 0.16 * np.deg2rad(47.0) / 0.2 / 0.027
    lost = 2e-3 + 1e-3 + pull * np.expm1(friction * np.pi / 2) / 3000.0
    assert usable_range(arm) == pytest.approx([1 - lost / full])
    tension = make_arm(
        modules=1,
        actuation="tension",
        module={"tension_range": 9.0, "cable": Cable(friction=0.2)},
    )
    assert usable_range(tension) == pytest.approx([np.exp(-0.2 * np.pi / 2)])


@pytest.mark.slow
def test_only_unreachable_goals_are_moved_to_the_nearest_shape(
    mismatched, reach, tmp_path
):
    actions = reach.random_actions(1, np.random.default_rng(2))
    inside = reach.states(actions)[0, -1, POSITION]
    places = ((1.0, inside), (2.0, inside), (2.5, (0, 0, 0.7)))
    rows = [f"{time},{','.join(map(str, place))}" for time, place in places]
    (tmp_path / "up.csv").write_text("\n".join(["time,x,y,z", *rows]))
    name = str(tmp_path / "up.csv")
    asked = load_task(name, mismatched)
    moved = made(ReachableTask(mismatched, name), Cache(tmp_path))
    before, after = asked.desired_positions()[:, -1], moved.desired_positions()[:, -1]
    np.testing.assert_allclose(before[:20], np.tile(inside, (20, 1)), atol=1e-6)
    np.testing.assert_array_equal(after[:16], before[:16])
    assert 0.56 < after[-1, 2] < 0.6
    assert moved.name == asked.name
    assert len(moved.goals) == len(asked.goals)
    assert np.isnan(moved.desired_positions()[:, :-1]).all()


def test_a_changed_task_has_another_file(mismatched, tmp_path):
    files = []
    for height in (0.5, 0.55):
        (tmp_path / "one.csv").write_text(
            f"time,x,y,z\n0.1,0,0,{height}\n0.2,0,0,{height}\n"
        )
        files.append(ReachableTask(mismatched, str(tmp_path / "one.csv")).file)
    assert files[0] != files[1]


@pytest.mark.slow
def test_random_targets_are_reachable_unless_they_should_not_be(
    mismatched, reach, tmp_path
):
    cache = Cache(tmp_path)
    inside = made(RandomTargets(mismatched, 4), cache)
    beyond = made(RandomTargets(mismatched, 4, unreachable_waypoints=True), cache)
    assert len(inside.task.goals) == len(beyond.task.goals) == 4 * 50
    assert not inside.distances.any()
    assert beyond.distances.min() > 0.01
    first = beyond.task.desired_positions()[0, -1]
    found = reach.nearest(Goal.of(3).with_position(first)).states
    assert np.linalg.norm(found[-1, POSITION] - first) > 0.01
    actions = reach.random_actions(4, np.random.default_rng([4, 0]))
    np.testing.assert_allclose(
        inside.task.desired_positions()[::50, -1],
        reach.states(actions)[:, -1, POSITION],
        atol=1e-6,
    )
    again = made(RandomTargets(mismatched, 4), cache)
    np.testing.assert_array_equal(
        again.task.desired_positions(), inside.task.desired_positions()
    )


def test_a_damaged_file_of_targets_is_replaced(mismatched, tmp_path):
    cache, targets = Cache(tmp_path), RandomTargets(mismatched, 2)
    made(targets, cache)
    targets.path(cache).write_bytes(b"nothing")
    with pytest.raises(S2C2AError, match="make them again"):
        targets.load(cache)
    assert len(made(targets, cache).task.goals) == 100
