"""A lasting position error is reported with its cause."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.evaluation import (
    describe_lasting_error,
    describe_plans,
    describe_step_plan,
)
from s2c2a.kinematics import configurations_from_bends
from s2c2a.planning import Outcome

TWIN = load_arm("twin_arm")
STEPS = 20
GOAL = np.array([0.18, 0.0, 0.5])


def make_run(
    outcome=Outcome.SOLVED, plan=0.0, model=0.0, untracked_deg=0.0, **columns
) -> Episode:
    """A run whose plan, model and bends are off in height by distances [m]."""
    goals = np.full((STEPS, 3, 3), np.nan)
    goals[:, -1] = GOAL
    predicted = np.zeros((STEPS, 3, 6))
    predicted[:, -1, :3] = GOAL + np.array([0.0, 0.0, plan])
    states = predicted + np.array([0.0, 0.0, model, 0.0, 0.0, 0.0])
    bends = np.zeros((STEPS, 3, 2), np.float32)
    planned = np.asarray(configurations_from_bends(bends))
    bends[..., 0] = np.deg2rad(untracked_deg)
    sensed = np.asarray(configurations_from_bends(bends))
    if untracked_deg:
        states[:, -1, 0] += 0.1
    steps = {
        "time": 0.1 * np.arange(STEPS),
        "actions": np.zeros((STEPS, 3, 3)),
        "desired_positions": goals,
        "predicted": predicted,
        "planned": planned,
        "sensed": sensed,
        "outcome": np.full(STEPS, int(outcome)),
        "plan_error": np.full(STEPS, abs(plan)),
        "sensor.states": states,
    }
    return Episode(TWIN, steps | columns)


def test_a_run_near_its_goals_is_not_described():
    assert describe_lasting_error(make_run()) == ""
    assert describe_lasting_error(make_run(plan=0.003, model=0.002)) == ""


def test_a_goal_out_of_reach_is_named_with_the_nearest_point():
    text = describe_lasting_error(make_run(Outcome.OUT_OF_REACH, plan=0.026))
    assert text == (
        "position error 2.6 cm in the last quarter of the run: the goal is out of "
        "reach by 2.6 cm of the arm's own model; the nearest point that the planner "
        "found at the end is (0.180, 0.000, 0.526) m"
    )


def test_a_payload_that_lifts_a_goal_out_of_reach_is_named():
    payload = np.full(STEPS, 0.15)
    run = make_run(Outcome.OUT_OF_REACH, plan=-0.03, payload=payload)
    text = describe_lasting_error(run)
    assert "with 150 g (estimated) the goal is out of reach by 3.0 cm" in text


@pytest.mark.parametrize("outcome", [Outcome.STALLED])
def test_a_planner_that_stands_still_is_named_and_a_slower_pace_is_no_advice(outcome):
    text = describe_lasting_error(make_run(outcome, plan=0.02))
    assert f"outcome {outcome.name}: the " in text
    assert "a slower pace does not help" in text


def test_steps_whose_plan_reaches_its_goal_do_not_explain_an_error():
    """Half of the last plans reach their goal; the others miss it by two causes."""
    run = make_run(plan=0.02)
    outcomes = np.full(STEPS, int(Outcome.OUT_OF_REACH))
    outcomes[1::2] = Outcome.STALLED
    outcomes[::3] = Outcome.SOLVED
    errors = np.where(outcomes == Outcome.SOLVED, 0.001, 0.02)
    columns = {"outcome": outcomes, "plan_error": errors}
    text = describe_lasting_error(Episode(TWIN, {**run.columns, **columns}))
    assert "SOLVED" not in text
    assert "2.0 cm" in text


def test_an_error_to_which_plan_tracking_and_model_add_a_little_is_named():
    text = describe_lasting_error(make_run(plan=0.0055, model=0.005))
    assert "plan, tracking and forward model each err a little" in text


def test_a_plan_beside_obstacles_is_named():
    obstacles = np.tile([0.2, 0.0, 0.5, 0.05], (STEPS, 1, 1))
    run = make_run(Outcome.STALLED, plan=0.2, obstacles=obstacles)
    assert "20.0 cm from its goal beside obstacles" in describe_lasting_error(run)


def test_only_for_a_plan_that_moves_behind_its_goal_a_slower_pace_is_advised():
    text = describe_lasting_error(make_run(Outcome.MOVING, plan=0.02))
    assert "the plan is 2.0 cm behind its goal; try a slower --pace" in text


def test_an_error_of_the_forward_model_is_named():
    text = describe_lasting_error(make_run(plan=0.001, model=0.02))
    assert "2.0 cm from where the forward model predicts them" in text


def test_bends_that_do_not_follow_the_plan_are_named():
    text = describe_lasting_error(make_run(untracked_deg=10.0))
    assert "the sensed bends stay 10.0 deg from the planned ones" in text


def test_without_states_the_plan_alone_is_described():
    run = make_run(Outcome.OUT_OF_REACH, plan=0.026)
    columns = {name: run[name] for name in run.columns if name != "sensor.states"}
    assert "out of reach by 2.6 cm" in describe_lasting_error(Episode(TWIN, columns))


def test_runs_without_plans_are_not_described():
    steps = {"time": np.arange(4.0), "actions": np.zeros((4, 3, 3))}
    assert describe_lasting_error(Episode(TWIN, steps)) == ""


def test_the_step_limit_is_not_blamed_for_goals_out_of_reach():
    """The plan moves by the whole step limit along the edge of the workspace."""
    angles = np.deg2rad(4.0) * np.arange(STEPS)[:, None]
    planned = np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=-1)
    columns = {"planned": planned.repeat(3, axis=1)}
    moving = make_run(Outcome.MOVING, plan=0.022, **columns)
    beyond = make_run(Outcome.OUT_OF_REACH, plan=0.022, **columns)
    assert "slower --pace" in describe_plans(moving)
    assert describe_plans(beyond) == (
        "the planner found its goal out of reach in 20 of 20 steps"
    )


def test_a_run_that_ends_out_of_reach_is_not_advised_to_be_slower():
    """The way to the goal is at the step limit, its end out of reach."""
    angles = np.deg2rad(4.0) * np.minimum(np.arange(STEPS), 10)[:, None]
    planned = np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=-1)
    outcomes = np.where(np.arange(STEPS) <= 10, Outcome.MOVING, Outcome.OUT_OF_REACH)
    run = make_run(plan=0.026, planned=planned.repeat(3, axis=1))
    text = describe_plans(Episode(TWIN, {**run.columns, "outcome": outcomes}))
    assert "the step limit of 4 deg held the plan back in 10 of 20 steps" in text
    assert "slower" not in text


def test_the_plan_of_a_step_is_described_where_it_does_not_get_nearer():
    def describe(outcome):
        return describe_step_plan({"outcome": outcome, "plan_error": np.array(0.026)})

    assert describe(Outcome.OUT_OF_REACH) == ("plan out of reach, 2.6 cm from its goal")
    assert describe(Outcome.STALLED) == "plan stalled, 2.6 cm from its goal"
    assert describe(Outcome.SOLVED) == describe(Outcome.MOVING) == ""
    assert describe(np.nan) == describe_step_plan({}) == ""


@pytest.mark.parametrize(
    "columns",
    [
        {"outcome": np.full(STEPS, 99)},
        {"outcome": np.full(STEPS, -1)},
        {"outcome": np.full(STEPS, np.nan)},
        {"predicted": np.full((STEPS, 3, 6), np.nan)},
        {"desired_positions": np.full((STEPS, 3, 3), np.nan)},
        {"plan_error": np.full(STEPS, np.inf)},
    ],
)
def test_telemetry_of_a_controller_that_is_no_plan_ends_no_run(columns):
    run = make_run(Outcome.OUT_OF_REACH, plan=0.05)
    run = replace(run, columns=run.columns | columns)
    assert describe_lasting_error(run) == ""
    assert isinstance(describe_plans(run), str)
