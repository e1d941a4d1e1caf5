"""A plan whose way is blocked stays beside the obstacles, and does not swing."""

from dataclasses import replace

import numpy as np
import pytest
from driven import MODEL, TWIN, driven, tips_of

from s2c2a.goals import Goal
from s2c2a.planning import BEST, Outcome, Planner
from s2c2a.planning.guides import CLOSEST
from s2c2a.planning.terms import GuardedPoints
from s2c2a.tasks import Task, load_task

from marks import slow_after


@pytest.mark.slow
@pytest.mark.parametrize(
    ("guides", "least"),
    slow_after(1, [(BEST.guides, CLOSEST * 0.04 * TWIN.length), ((), 0.02)]),
)
def test_the_whole_arm_keeps_clear_of_obstacles_that_leave_no_straight_way(
    guides, least
):
    """Iterations that go to and fro across edges lead the plan into the margin.

    Without a guide it keeps its margin; with one, the least that a way keeps.
    """
    task = load_task("risk-b", TWIN)
    options = replace(BEST, guard="arm", guides=guides)
    goals = list(task.shown_goals(TWIN))[:60]
    plans, _ = driven(Planner(TWIN, MODEL, options), goals)
    points_of = GuardedPoints.of(TWIN, "arm")
    for plan, goal in zip(plans, goals, strict=True):
        points = np.asarray(points_of(plan.expectation.states))
        distances = np.linalg.norm(points[:, None] - goal.obstacles, axis=-1)
        used = goal.thresholds > 0.0
        assert (distances - goal.thresholds)[:, used].min() > least


@pytest.mark.parametrize("foreseen", [True, False])
@pytest.mark.parametrize("beside", [0.0, 0.01])
def test_the_tip_skirts_a_sphere_on_the_path_of_its_target(foreseen, beside):
    """It neither waits before the sphere nor jumps past it, also where it meets it head-on."""
    turns = np.linspace(-1.2, 1.2, 60)[:, None]
    path = np.hstack([0.18 * np.cos(turns), 0.18 * np.sin(turns), 0.56 + 0.0 * turns])
    center, threshold = np.array([0.18, beside, 0.56 + beside]), 0.04
    goal = Goal.of(3).with_obstacles([center], [threshold])
    task = replace(Task.along("arc", path, goal), foreseen=foreseen)
    goals = list(task.shown_goals(TWIN))
    plans, planned = driven(Planner(TWIN, MODEL, BEST), [goals[0]] * 30 + goals)
    assert Outcome.PASSING in {plan.outcome for plan in plans}
    tips = tips_of(planned)[30:]
    ways = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    kept = threshold + 0.04 * TWIN.length
    depths = np.maximum(kept - np.linalg.norm(path - center, axis=1), 0.0)
    errors = np.linalg.norm(tips - path, axis=1)
    assert np.linalg.norm(tips - center, axis=1).min() > threshold + 0.01
    assert errors[depths > 0.0].mean() < 1.5 * depths[depths > 0.0].mean()
    assert ways.max() < 0.03
    assert ways.min() > 0.0005
