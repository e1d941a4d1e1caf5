"""A plan whose way is blocked stays beside the obstacles, and does not swing."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.estimation import Estimate
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import BEST, Planner
from s2c2a.planning.guides import CLOSEST
from s2c2a.planning.terms import GuardedPoints
from s2c2a.tasks import load_task

from marks import slow_after

TWIN = load_arm("twin_arm")
STRAIGHT = np.tile([0.0, 0.0, 1.0], (3, 1))


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
    planner = Planner(TWIN, PCCForwardModel.of(TWIN), options)
    plan = planner.start(Estimate(STRAIGHT))
    points_of = GuardedPoints.of(TWIN, "arm")
    clearances = []
    for goal in list(task.shown_goals(TWIN, planner.margin))[:60]:
        plan = planner.plan(plan, Estimate(plan.configurations), goal)
        points = np.asarray(points_of(plan.expectation.states))
        distances = np.linalg.norm(points[:, None] - goal.obstacles, axis=-1)
        used = goal.thresholds > 0.0
        clearances.append((distances - goal.thresholds)[:, used].min())
    assert min(clearances) > least
