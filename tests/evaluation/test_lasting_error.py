"""A lasting position error is reported with its parts."""

from dataclasses import replace

import numpy as np
import pytest

from made_up import TWIN, made_up
from s2c2a.episodes import Episode
from s2c2a.evaluation import (
    describe_lasting_error,
    describe_plans,
    describe_step_plan,
)
from s2c2a.kinematics import configurations_from_bends
from s2c2a.planning import Outcome

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
        "desired_positions": goals,
        "predicted": predicted,
        "planned": planned,
        "sensed": sensed,
        "outcome": np.full(STEPS, int(outcome)),
        "plan_error": np.full(STEPS, abs(plan)),
        "sensor.states": states,
    }
    return made_up(STEPS, **steps | columns)


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"plan": 0.026}, (2.6, 2.6, 0.0, 0.0)),
        ({"plan": 0.001, "model": 0.02}, (2.1, 0.1, 0.0, 2.0)),
        ({"plan": 0.0055, "model": 0.005}, (1.0, 0.5, 0.0, 0.5)),
    ],
)
def test_an_error_is_told_with_the_parts_of_plan_tracking_and_model(parts, told):
    error, plan, tracking, model = told
    assert describe_lasting_error(make_run(**parts)) == (
        f"median position error {error} cm in the last quarter of the run: the plan is "
        f"{plan} cm from its goal, the sensed arm {tracking} cm from the plan, the true "
        f"arm {model} cm from where the forward model predicts it"
    )


def test_bends_that_do_not_follow_the_plan_are_a_part_of_their_own():
    text = describe_lasting_error(make_run(untracked_deg=10.0))
    assert "the plan is 0.0 cm from its goal, the sensed arm 15" in text


def test_without_states_the_true_arm_is_not_told_of():
    run = make_run(plan=0.026)
    columns = {name: run[name] for name in run.columns if name != "sensor.states"}
    text = describe_lasting_error(Episode(TWIN, columns))
    assert text.endswith("2.6 cm from its goal, the sensed arm 0.0 cm from the plan")


def test_runs_without_plans_are_not_described():
    assert describe_lasting_error(made_up(4)) == ""


def test_the_step_limit_is_not_blamed_for_goals_out_of_reach():
    """The plan moves by the whole step limit along the edge of the workspace."""
    angles = np.deg2rad(4.0) * np.arange(STEPS)[:, None]
    planned = np.stack([np.sin(angles), 0.0 * angles, np.cos(angles)], axis=-1)
    columns = {"planned": planned.repeat(3, axis=1)}
    moving = make_run(Outcome.MOVING, plan=0.022, **columns)
    beyond = make_run(Outcome.OUT_OF_REACH, plan=0.022, **columns)
    assert "the step limit of 4 deg" in describe_plans(moving)
    assert describe_plans(beyond) == (
        "the planner came no nearer to its goal in 20 of 20 steps"
    )


def test_the_plan_of_a_step_is_described_where_it_does_not_get_nearer():
    def describe(outcome):
        return describe_step_plan({"outcome": outcome, "plan_error": np.array(0.026)})

    assert describe(Outcome.OUT_OF_REACH) == ("plan out of reach, 2.6 cm from its goal")
    assert describe(Outcome.STALLED) == "plan stalled, 2.6 cm from its goal"
    assert describe(Outcome.OVERLOADED) == "plan overloaded, 2.6 cm from its goal"
    assert describe(Outcome.SOLVED) == describe(Outcome.MOVING) == ""
    assert describe(np.nan) == describe_step_plan({}) == ""


@pytest.mark.parametrize(
    "columns",
    [
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
