import sys

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.strategies import RECIPES, RunOptions
from s2c2a_experiments.planners.differential_ik import DifferentialIK

from ideal_arm import drive_ideal

STEPS = 40


def test_steps_and_bends_stay_within_their_limits(twin):
    driver = DifferentialIK().build(twin, RECIPES["best"], None, RunOptions("arm"))
    geometry = ArmGeometry.of(twin)
    goal = Goal.of(3).with_position([0.6, 0.0, 0.0])
    bends, _ = drive_ideal(driver, twin, [goal] * STEPS)
    steps = np.linalg.norm(np.diff(bends, axis=0), axis=-1)
    sizes = np.linalg.norm(bends, axis=-1)
    assert geometry.step_limit * 0.9 < steps.max() <= geometry.step_limit + 1e-4
    assert (sizes <= geometry.planned_bends + 1e-4).all()


def test_a_missing_solver_names_the_extra(twin, monkeypatch):
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(S2C2AError, match="planners"):
        DifferentialIK().build(twin, RECIPES["best"], None, RunOptions())
