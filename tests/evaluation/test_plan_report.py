"""Descriptions of the steps in which planning was difficult."""

import numpy as np
import pytest

from made_up import made_up
from s2c2a.arm import load_arm
from s2c2a.evaluation import (
    describe_faults,
    describe_jumps_of_frame,
    describe_lost_states,
    describe_plans,
    describe_touches,
    describe_tracking,
)
from s2c2a.planning import Outcome


@pytest.mark.parametrize(
    ("columns", "text"),
    [
        ({}, ""),
        ({"outcome": np.zeros(4)}, ""),
        (
            {"outcome": np.array([0.0, 5.0, 5.0, np.nan])},
            "the planner stood still short of its goal in 2 of 4 steps",
        ),
        (
            {"outcome": np.array([0, 5, 6, 6])},
            "the planner stood still short of its goal in 1 of 4 steps, "
            "the planner came no nearer to its goal in 2 of 4 steps",
        ),
        (
            {"outcome": np.array([0, Outcome.MOVING, *[Outcome.OVERLOADED] * 2])},
            "the planner found the arm overloaded in 2 of 4 steps",
        ),
        (
            {"outcome": np.array([0, Outcome.PASSING, Outcome.PASSING, 0])},
            "an obstacle on or near the path of the target kept the tip off in 2 of 4 steps",
        ),
    ],
)
def test_steps_are_counted_by_outcome(columns, text):
    assert describe_plans(made_up(4, **columns)) == text


def test_a_target_and_a_tip_within_an_obstacle_are_named():
    """A ball of 5 cm around the target, in which the tip is from the third step on."""
    target = np.array([0.1, 0.0, 0.5])
    ball = np.tile([*target, 0.05], (5, 1, 1))
    states = np.zeros((5, 3, 6))
    states[:, -1, :3] = target + np.outer([0.2, 0.1, 0.06, 0.04, 0.03], [1, 0, 0])
    columns = {"desired_positions": np.tile(target, (5, 3, 1)), "obstacles": ball}
    beside = columns | {"desired_positions": np.zeros((5, 3, 3))}
    target_text = "the target was up to 5.0 cm within an obstacle, first 0.1 s after"
    tip_text = "the tip was up to 2.0 cm within an obstacle, first 0.3 s after"
    seen = {"sensor.states": states}
    found = describe_touches(made_up(5, **columns, **seen))
    assert found == f"{target_text} the start, {tip_text} the start"
    assert describe_touches(made_up(5, **beside)) == ""
    assert describe_touches(made_up(5)) == ""


@pytest.mark.parametrize("sensor", ["states", "center_line"])
def test_a_body_within_an_obstacle_beside_a_free_tip_is_named(sensor):
    """A ball of 5 cm, 1 cm beside the second module's end from the second step on."""
    end = np.array([0.0, 0.0, 0.4])
    states = np.zeros((5, 3, 6))
    states[:, :, 2] = [0.2, 0.4, 0.6]
    seen = {"sensor.states": states}
    if sensor == "center_line":
        seen["sensor.center_line"] = states[:, None, :, :3]
    ball = np.tile([*end, 0.05], (5, 1, 1))
    ball[0, 0, :3] += 1.0
    ball[1:, 0, 0] += 0.01
    columns = {"desired_positions": np.full((5, 3, 3), np.nan), "obstacles": ball}
    arm = load_arm("twin_arm")
    depth = 100 * (0.05 - 0.01 + arm.modules[1].radius)
    assert describe_touches(made_up(5, **columns, **seen)) == (
        f"the body (see --guard arm) was up to {depth:.1f} cm within an "
        "obstacle, first 0.2 s after the start"
    )


def test_an_obstacle_on_the_way_to_rest_is_named():
    """A ball of 5 cm at the third module's end at rest, which the run ends beside."""
    states = np.zeros((5, 3, 6))
    states[:, :, 2] = [0.2, 0.4, 0.6]
    states[:4, -1, 0] = 0.3
    columns = {
        "stage": np.array([2, 2, 2, 4, 4], np.int8),
        "desired_positions": np.full((5, 3, 3), np.nan),
        "obstacles": np.tile([0.0, 0.0, 0.6, 0.05], (5, 1, 1)),
        "sensor.states": states,
    }
    columns["obstacles"][3:] = 0.0  # of a goal without any
    depth = 100 * (0.05 + load_arm("twin_arm").modules[2].radius)
    assert describe_touches(made_up(5, **columns)) == (
        f"the arm on its way to rest was up to {depth:.1f} cm within an obstacle, "
        "first 0.4 s after the start"
    )


HELD_POINT = [[0.02, 0, 0]] * 4
PATH = [[0.02, 0, 0], [0, 0, 0], [0, 0.02, 0], [0.02, 0, 0]]


@pytest.mark.parametrize(
    ("tip", "text"),
    [(PATH, "1 of 4 steps (a slower --pace helps)"), (HELD_POINT, "2 of 4 steps")],
)
def test_plans_that_the_step_limit_holds_back_are_counted(tip, text):
    """Two whole steps, the first of which reaches the path, and a shorter one."""
    angles = np.deg2rad([0.0, 4.0, 8.0, 11.0])[:, None]
    planned = np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=-1)
    planned = planned.repeat(3, axis=1)
    desired = np.full((4, 3, 3), np.nan)
    desired[:, -1] = tip
    outcome = np.full(4, Outcome.MOVING)
    if tip is PATH:
        outcome[1] = Outcome.SOLVED
    episode = made_up(4, planned=planned, outcome=outcome, desired_positions=desired)
    assert describe_plans(episode) == (
        f"the step limit of 4 deg held the plan back in {text}"
    )


def test_faults_of_readings_are_reported_with_the_steps_in_which_the_arm_was_held():
    episode = made_up(4, stage=np.array([2, 3, 3, 2], np.int8))
    assert describe_faults(episode) == ""
    faulty = episode.with_options(faults=["servo 1 does not answer"], late_steps=5)
    assert describe_faults(faulty) == (
        "the arm was held in 2 steps because of faults (servo 1 does not answer); "
        "5 steps began late"
    )


def test_untracked_module_ends_are_reported():
    states = np.zeros((4, 3, 6))
    assert describe_tracking(made_up(4, **{"sensor.states": states})) == ""
    states[:2, 1] = np.nan
    lost = "ends not tracked: module 2 in 50 % of the steps"
    assert describe_tracking(made_up(4, **{"sensor.states": states})) == lost
    assert describe_lost_states(states[None]) == lost
    assert "add --tracking" in describe_tracking(made_up(4))


def test_a_jump_of_all_module_ends_is_reported():
    states = np.random.default_rng(0).normal(0, 1e-4, (40, 3, 6))
    states += [[0, 0, height, 0, 0, 1] for height in (0.2, 0.4, 0.6)]
    still = made_up(40, **{"sensor.states": states})
    assert describe_tracking(still) == ""
    states = states.copy()
    states[25:, :, 0] += 0.0058
    knocked = made_up(40, **{"sensor.states": states})
    text = describe_tracking(knocked)
    assert text.startswith("step 26 (2.5 s): all tracked ends jump by 5.")
    assert "episode 2, step 26" in describe_jumps_of_frame([still, knocked])
