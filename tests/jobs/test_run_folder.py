"""What is drawn of a run counts as its table does."""

from types import SimpleNamespace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode
from s2c2a.jobs.job import Conditions
from s2c2a.jobs.run_folder import summary_of, trace_of
from s2c2a.planning import Goal
from s2c2a.robots import RobotFactory
from s2c2a.tasks import Score, Task

TWIN = load_arm("twin_arm")
STEPS, MODULES = 6, 3
EARLY, LATE = np.arange(STEPS) < 2, np.arange(STEPS) >= 2


def trace(*scores: Score):
    goal = (
        Goal.of(MODULES)
        .with_position([0.1, 0.0, 0.2], module=0)
        .with_position([0.1, 0.0, 0.5])
    )
    task = Task("two ends", (goal,) * STEPS, scores)
    columns = {"time": 0.1 * np.arange(STEPS), "actions": np.zeros((STEPS, MODULES, 3))}
    columns |= {
        "sensor.states": np.zeros((STEPS, MODULES, 6)),
        "desired_positions": task.desired_positions(),
    }
    run = SimpleNamespace(
        strategy="s2c2a", job=SimpleNamespace(task=task), episode=Episode(TWIN, columns)
    )
    return trace_of(run)


@pytest.mark.parametrize("tip", [-1, 2])
def test_counted_steps_are_those_of_the_drawn_module(tip):
    both = trace(
        Score("position", 0, EARLY),
        Score("position", tip, LATE),
        Score("recovery", tip, EARLY),
    )
    np.testing.assert_array_equal(both.counted, LATE)


def test_all_steps_count_without_a_position_score():
    assert trace(Score("position")).counted is None
    assert trace(Score("position", 0, EARLY)).counted is None


@pytest.mark.parametrize(
    ("factory", "named"),
    [
        (RobotFactory.simulation("accurate"), {"simulation": "accurate"}),
        (RobotFactory("dynamixel"), {"robot": "dynamixel"}),
    ],
)
def test_a_real_robot_is_not_called_a_simulation(factory, named):
    job = SimpleNamespace(
        recipe=SimpleNamespace(name="best"), conditions=Conditions(factory), seed=3
    )
    assert summary_of(job) == {"recipe": "best", "seed": "3"} | named
