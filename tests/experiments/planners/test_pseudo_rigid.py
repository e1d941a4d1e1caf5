from dataclasses import replace

import jax
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.goals import Goal
from s2c2a.kinematics import configurations_from_bends, states_from_bends
from s2c2a.spaces import AXIS, POSITION
from s2c2a.strategies import RECIPES, RunOptions
from s2c2a_experiments.planners.pseudo_rigid import LinkModel, PseudoRigid

from ideal_arm import drive_ideal

BENDS = np.array([[0.3, 0.1], [0.2, -0.2], [-0.1, 0.4]], np.float32)
FORCE = 1e-3  # N; small beside the arm's stiffness


def predicted(model, bends):
    configurations = configurations_from_bends(bends)
    return np.asarray(jax.jit(LinkModel.predict)(model, configurations, ()))


def weightless(arm, links):
    model = LinkModel.of(arm, links, 1.0)
    stiff = np.ones(arm.module_count, np.float32)
    return replace(model, gravity=np.zeros(3, np.float32), passed=stiff)


def test_many_links_without_weight_are_arcs(twin):
    lengths = ArmGeometry.of(twin).lengths.astype(np.float32)
    arcs = states_from_bends(BENDS, lengths)
    np.testing.assert_allclose(predicted(weightless(twin, 20), BENDS), arcs, atol=2e-4)


def test_a_sideways_weight_bends_like_a_cantilever(twin):
    """A free module of length L and mass m: its tip turns by m g L^2 / (6 EI)."""
    model = LinkModel.of(twin, 20, 1.0)
    pull = np.array([FORCE, 0.0, 0.0], np.float32)
    model = replace(
        model,
        lengths=model.lengths[:1],
        masses=np.ones(1, np.float32),
        compliances=model.compliances[:1],
        held=np.zeros(1, np.float32),
        passed=np.ones(1, np.float32),
        gravity=pull,
    )
    tip = predicted(model, np.zeros((1, 2), np.float32))[-1]
    length = float(model.lengths[0])
    expected = FORCE * length / 6.0 * float(model.compliances[0])
    np.testing.assert_allclose(tip[AXIS][:2], [expected, 0.0], rtol=0.02, atol=1e-7)


def test_elastic_cables_pass_on_a_part_of_the_bend(twin):
    springs = ArmGeometry.of(twin).cable_springs / 2.0
    module = twin.modules[0]
    own = module.bending_stiffness / module.length
    expected = springs[0] / (springs[0] + own)
    np.testing.assert_allclose(
        LinkModel.of(twin, 4, 1.0).passed[0], expected, rtol=1e-4
    )


@pytest.mark.slow
def test_cables_go_on_until_the_links_reach_the_target(twin):
    options = PseudoRigid(links=2)
    model = options.model(twin)
    target = predicted(model, BENDS)[-1, POSITION]
    driver = options.build(twin, RECIPES["best"], None, RunOptions())
    goal = Goal.of(3).with_position(target)
    bends, _ = drive_ideal(driver, twin, [goal] * 40)
    reached = predicted(model, bends[-1])[-1, POSITION]
    assert np.linalg.norm(reached - target) < 0.005
