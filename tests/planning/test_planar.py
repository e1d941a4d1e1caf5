"""Planning for arms whose cables command one direction of bends only."""

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.estimation import Estimate
from s2c2a.goals import Goal
from s2c2a.kinematics import bends_from_configurations, commanded_part
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import PAPER, Planner

TARGETS = np.array([[0.05, 0.0, 0.085], [-0.03, 0.01, 0.095]])
STEPS_EACH = 15


def finger(turn_deg):
    """The planar finger, its cables turned about its axis."""
    arm = load_arm("planar_finger")
    angles = tuple(angle + turn_deg for angle in arm.modules[0].cable_angles_deg)
    modules = tuple(
        each.model_copy(update={"cable_angles_deg": angles}) for each in arm.modules
    )
    return arm.model_copy(update={"modules": modules})


@pytest.mark.slow
@pytest.mark.parametrize("turn_deg", [0.0, 35.0])
def test_rounding_of_inputs_does_not_decide_where_a_planar_arm_goes(turn_deg):
    arm = finger(turn_deg)
    planner = Planner(arm, PCCForwardModel.of(arm), PAPER)
    estimate = Estimate(np.tile([0.1, 0.05, 0.99], (2, 1)))
    random = np.random.default_rng(0)
    plan = planner.start(estimate)
    bends, changes = [], []
    for target in np.repeat(TARGETS, STEPS_EACH, axis=0):
        goal = Goal.of(2).with_position(target)
        noise = 1e-7 * random.normal(size=(2, 3)).astype(np.float32)
        near = plan._replace(configurations=plan.configurations + noise)
        other = planner.plan(near, estimate, goal)
        plan = planner.plan(plan, estimate, goal)
        bends.append(np.asarray(bends_from_configurations(plan.configurations)))
        change = bends_from_configurations(other.configurations) - bends[-1]
        changes.append(np.abs(change).max())
    moved = np.ptp(bends, axis=0).max()
    assert moved > 0.2
    assert np.median(changes) < 1e-5 * moved
    assert np.max(changes) < 1e-4 * moved
    steered = commanded_part(np.array(bends), ArmGeometry.of(arm).steerable)
    np.testing.assert_allclose(bends, steered, atol=1e-6)
