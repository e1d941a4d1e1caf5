"""Plans of both recipes are those of version 0.1, step by step, from where its plans stood."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.kinematics import PCCForwardModel
from s2c2a.planning import BEST, PAPER, Goal, Planner
from s2c2a.planning.terms import Axes

TWIN = load_arm("twin_arm")
ALIKE = replace(
    BEST, terms=tuple(Axes() if isinstance(term, Axes) else term for term in BEST.terms)
)
"""Best, with axes that count as much as they did."""
BEFORE = np.load(Path(__file__).with_name("plans_of_0_1.npz"))
"""Recipe, guard and goal -> where it began, and five plans on: shape (6, modules,
3)."""

FREE = Goal.of(3).with_position([0.25, 0.12, 0.48], 1.3).with_axis([0.5, 0.2, 1.0])
BESIDE = [[0.12, 0.2, 0.5], [0.2, 0.0, 0.5], [0.05, 0.1, 0.3]], [0.08, 0.1, 0.06], 0.6
BETWEEN = [[0.309, 0.0, 0.4355], [-0.1, 0.05, 0.35]], [0.05, 0.07]
GOALS = {
    "free": FREE,
    "middle": Goal.of(3, 0.2)
    .with_position([0.11, 0.06, 0.37], 4.0, module=1)
    .with_axis([0.1, 0.8, 1.0], 0.7),
    "beside": FREE.with_obstacles(*BESIDE),
    "behind": Goal.of(3).with_position([0.309, 0.155, 0.4355]).with_obstacles(*BETWEEN),
}


@pytest.mark.parametrize("guard", ["tip", "arm"])
@pytest.mark.parametrize(("recipe", "options"), [("paper", PAPER), ("best", ALIKE)])
def test_plans_are_what_they_were(recipe, options, guard):
    """To rounding; where a step of least squares is hardly kept or refused, those of 0.1 change by 1e-4 themselves with
    the last digit of where they begin.
    """
    planner, apart = (
        Planner(TWIN, PCCForwardModel.of(TWIN), replace(options, guard=guard)),
        [],
    )
    for name, goal in GOALS.items():
        path = BEFORE[f"{recipe} {guard} {name}"]
        assert np.abs(np.diff(path, axis=0)).max() > 0.01
        plans = [
            planner.plan(planner.start(last), last, goal).configurations
            for last in path[:-1]
        ]
        apart += list(np.abs(plans - path[1:]).max(axis=(1, 2)))
    assert np.max(apart) < 2e-4
    assert np.quantile(apart, 0.75) < 5e-6
