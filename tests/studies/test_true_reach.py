"""What an arm really reaches: the search agrees with the simulated arm, finds what is there, and says what is not."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, Cable, randomized_arm, load_arm
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.jobs import Cache, made
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import AXIS, POSITION
from s2c2a.studies import true_reach
from s2c2a.studies.targets import KEPT, HeldTargets, ReachableTask
from s2c2a.studies.true_reach import TrueReach, usable_shares
from s2c2a.tasks import task_named

TWIN = load_arm("twin_arm")


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Searches begin from fewer shapes."""
    monkeypatch.setattr(true_reach, "SAMPLES", 256)


@pytest.fixture(scope="module")
def drawn():
    """An arm with every mismatch."""
    return randomized_arm(TWIN, 3, 1.0)


@pytest.fixture(scope="module")
def reach(drawn):
    """A search on it."""
    return TrueReach(drawn)


def without_memory(arm):
    """What is left of an arm that has forgotten all."""
    lasting = [
        module.model_copy(
            update={
                "cable": module.cable.model_copy(update={"play": 0.0, "friction": 0.0}),
                "mismatch": module.mismatch.model_copy(update={"relaxing": (0.0, 0.0)}),
            }
        )
        for module in arm.modules
    ]
    motor = arm.motor.model_copy(update={"homing_error": 0.0})
    return arm.model_copy(update={"modules": tuple(lasting), "motor": motor})


def test_resting_shapes_are_those_of_the_simulated_arm_once_it_has_aged_and_settled(
    drawn, reach
):
    shares = reach.random_shares(3, np.random.default_rng(1))
    robot = SimulatedRobot(without_memory(drawn), aged=1.0)
    for one, states in zip(shares, reach.states(shares), strict=True):
        robot.open()
        for _ in range(100):
            robot.step(ArmGeometry.of(drawn).actions_at(one))
        np.testing.assert_allclose(robot.states(), states, atol=2e-4)


def test_a_tip_that_the_arm_has_been_at_is_found_again(reach):
    tips = reach.states(reach.random_shares(3, np.random.default_rng(5)))[
        :, -1, POSITION
    ]
    for tip in tips:
        assert reach.nearest(Goal.of(3).with_position(tip)).miss < KEPT


def test_a_target_above_the_arm_is_missed_by_what_it_is_too_short(reach):
    highest = reach.nearest(Goal.of(3).with_position([0.0, 0.0, 0.9])).states[
        -1, POSITION
    ]
    assert 0.56 < highest[2] < 0.6
    assert np.linalg.norm(highest[:2]) < 0.1


def test_an_axis_is_sought_beside_a_position(reach):
    asked = reach.states(reach.random_shares(1, np.random.default_rng(8)))[0]
    goal = (
        Goal.of(3)
        .with_position(asked[1, POSITION], module=1)
        .with_axis(asked[1, AXIS], module=1)
    )
    found = reach.nearest(goal).states
    assert np.linalg.norm(found[1, POSITION] - asked[1, POSITION]) < KEPT
    assert found[1, AXIS] @ asked[1, AXIS] > np.cos(np.deg2rad(2.0))


def test_what_play_homing_and_friction_may_take_is_not_counted_on(make_arm):
    """One module: 22 mm at full bend of 0.8 rad, T = EI b / (L r)."""
    full, friction = 0.027 * np.deg2rad(47.0), 0.1
    cable = Cable(
        play=(1e-3, 2e-3, 0.0),
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
    assert usable_shares(arm) == pytest.approx([1 - lost / full])
    tension = make_arm(
        modules=1,
        actuation="tension",
        module={"tension_range": 9.0, "cable": Cable(friction=0.2)},
    )
    assert usable_shares(tension) == pytest.approx([np.exp(-0.2 * np.pi / 2)])


def test_goals_within_reach_stay_and_others_are_put_where_the_arm_gets_nearest(
    drawn, reach, tmp_path
):
    inside = reach.states(reach.random_shares(1, np.random.default_rng(2)))[
        0, -1, POSITION
    ]
    places = ((1.0, inside), (2.0, inside), (2.5, (0, 0, 0.7)))
    lines = [
        "time,x,y,z",
        *(f"{time},{','.join(map(str, place))}" for time, place in places),
    ]
    (tmp_path / "up.csv").write_text("\n".join(lines))
    name = str(tmp_path / "up.csv")
    asked, moved = (
        task_named(name, drawn),
        made(ReachableTask(drawn, name), Cache(tmp_path)),
    )
    before, after = asked.desired_positions()[:, -1], moved.desired_positions()[:, -1]
    np.testing.assert_allclose(before[:20], np.tile(inside, (20, 1)), atol=1e-6)
    np.testing.assert_array_equal(after[:16], before[:16])
    assert 0.56 < after[-1, 2] < 0.6
    assert moved.name == asked.name
    assert len(moved.goals) == len(asked.goals)
    assert np.isnan(moved.desired_positions()[:, :-1]).all()


def test_a_task_that_changed_is_searched_anew(drawn, tmp_path):
    files = []
    for height in (0.5, 0.55):
        (tmp_path / "one.csv").write_text(
            f"time,x,y,z\n0.1,0,0,{height}\n0.2,0,0,{height}\n"
        )
        files.append(ReachableTask(drawn, str(tmp_path / "one.csv")).file)
    assert files[0] != files[1]


def test_held_targets_are_places_where_the_arm_was_and_those_beyond_are_not(
    drawn, reach, tmp_path
):
    cache = Cache(tmp_path)
    inside, beyond = (
        made(HeldTargets(drawn, 4), cache),
        made(HeldTargets(drawn, 4, beyond=True), cache),
    )
    assert len(inside.task.goals) == len(beyond.task.goals) == 4 * 50
    assert not inside.distances.any()
    assert beyond.distances.min() > 0.01
    first = beyond.task.desired_positions()[0, -1]
    assert (
        np.linalg.norm(
            reach.nearest(Goal.of(3).with_position(first)).states[-1, POSITION] - first
        )
        > 0.01
    )
    shares = reach.random_shares(4, np.random.default_rng([4, 0]))
    np.testing.assert_allclose(
        inside.task.desired_positions()[::50, -1],
        reach.states(shares)[:, -1, POSITION],
        atol=1e-6,
    )
    again = made(HeldTargets(drawn, 4), cache)
    np.testing.assert_array_equal(
        again.task.desired_positions(), inside.task.desired_positions()
    )


def test_a_damaged_file_of_targets_is_made_again(drawn, tmp_path):
    cache, targets = Cache(tmp_path), HeldTargets(drawn, 2)
    made(targets, cache)
    targets.path(cache).write_bytes(b"nothing")
    with pytest.raises(S2C2AError, match="make them again"):
        targets.load(cache)
    assert len(made(targets, cache).task.goals) == 100
