"""Static shapes with analytical solutions: bends by cables, beams under loads."""

import numpy as np
import pytest

from held_arm import action_for, bends, settled
from s2c2a.arm import ArmGeometry, Cable
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot

from rod import rod_shape

WEIGHTLESS = (0.0, 0.0, 0.0)
LENGTH, RADIUS, MASS = 0.2, 0.027, 0.075
PULL = {"actuation": "tension", "gravity_direction": WEIGHTLESS}


def test_one_cable_bends_a_weightless_module_by_its_moment_over_the_rigidity(
    make_arm, fidelity
):
    """F = T r L / EI towards the cable."""
    arm = make_arm(modules=1, module={"tension_range": 20.0}, **PULL)
    robot = settled(arm, [[0.0, 10.0, 0.0]], fidelity)
    angle = 10.0 * RADIUS * LENGTH / 0.16
    direction = np.array([np.cos(2 * np.pi / 3), np.sin(2 * np.pi / 3)])
    np.testing.assert_allclose(bends(robot), [angle * direction], atol=0.01 * angle)


def test_bent_cables_in_balance_keep_a_module_straight(make_arm):
    arm = make_arm(modules=1, module={"tension_range": 20.0}, **PULL)
    np.testing.assert_allclose(bends(settled(arm, [[9.0, 9.0, 9.0]])), 0, atol=1e-9)


@pytest.mark.parametrize("cables", [3, 4, 5, 8])
def test_taut_cables_that_stretch_bend_a_module_by_their_share_of_the_stiffness(
    make_arm, fidelity, cables
):
    """B K / (K + EI / L) with K = n k r^2 / 2."""
    module = {"pretension": 40.0, "cable": Cable(stiffness=3000.0)}
    arm = make_arm(1, cables, module, gravity_direction=WEIGHTLESS)
    asked = np.array([0.2, -0.1])
    robot = settled(arm, RADIUS * ArmGeometry.of(arm).cable_matrices @ asked, fidelity)
    cable_stiffness = cables / 2 * 3000.0 * RADIUS**2
    share = cable_stiffness / (cable_stiffness + 0.16 / LENGTH)
    assert robot.tensions().min() > 0
    np.testing.assert_allclose(bends(robot), [share * asked], rtol=0.02)


def test_cables_shortened_together_only_get_tighter(make_arm, fidelity):
    """T = T0 + k d: the chain does not give along its axis."""
    module = {"pretension": 2.0, "cable": Cable(stiffness=5000.0)}
    arm = make_arm(2, 3, module, gravity_direction=WEIGHTLESS)
    robot = settled(arm, np.full((2, 3), -0.004), fidelity)
    np.testing.assert_allclose(robot.tensions(), 22.0)
    np.testing.assert_allclose(bends(robot), 0, atol=1e-9)


def test_lengthened_cables_hang_slack(make_arm):
    arm = make_arm(1, 3, gravity_direction=WEIGHTLESS)
    robot = settled(arm, np.full((1, 3), 0.01))
    np.testing.assert_array_equal(robot.tensions(), 0)


@pytest.mark.parametrize("preset", ["twin", "simulated"])
def test_no_action_causes_a_negative_tension(preset, fidelity, request):
    arm = request.getfixturevalue(preset)
    geometry, random = ArmGeometry.of(arm), np.random.default_rng(0)
    robot = SimulatedRobot(arm, fidelity)
    robot.open()
    tensions = []
    for _ in range(25):
        robot.step(random.uniform(geometry.action_low, geometry.action_high))
        tensions.append(robot.tensions())
    assert np.min(tensions) >= 0
    assert np.max(tensions) > 5


def test_a_pull_on_the_last_module_bends_lower_ones_only_where_cables_are_coupled(
    make_arm, fidelity
):
    changes = {"module": {"tension_range": 20.0}, **PULL}
    action = [[0.0] * 3, [0.0] * 3, [8.0, 0.0, 0.0]]
    apart, coupled = (
        settled(make_arm(coupled_cables=c, **changes), action, fidelity)
        for c in (False, True)
    )
    angle = 8.0 * RADIUS * LENGTH / 0.16
    np.testing.assert_allclose(
        bends(apart), [[0, 0], [0, 0], [angle, 0]], atol=0.02 * angle
    )
    np.testing.assert_allclose(bends(coupled), [[angle, 0]] * 3, atol=0.04 * angle)


def test_a_small_force_bends_a_weightless_module_like_a_clamped_beam(
    make_arm, fidelity
):
    """F L^3 / (3 EI) (1 - 1 / (4 n^2)) for n hinges in the middle of their segments."""
    arm = make_arm(1, 3, {"tension_range": 20.0, "bending_stiffness": 1.0}, **PULL)
    force, segments = np.array([0.1, 0.2, 0.0]), FIDELITIES[fidelity].segments
    expected = force[:2] * LENGTH**3 / 3 * (1 - 0.25 / segments**2)
    tip = settled(arm, push=force, fidelity=fidelity).states()[0, :2]
    np.testing.assert_allclose(tip, expected, rtol=1e-4)


def test_weight_bends_a_lying_module_like_a_clamped_beam(make_arm, fidelity):
    """W L^4 / (8 EI) (1 - 1 / 2n^2); a payload adds P L^3 / (3 EI) (1 - 1 / 4n^2)."""
    lying = {"actuation": "tension", "gravity_direction": (0.6, 0.8, 0.0)}
    arm = make_arm(1, 3, {"tension_range": 20.0, "bending_stiffness": 10.0}, **lying)
    segments = FIDELITIES[fidelity].segments
    own = MASS * 9.81 * LENGTH**3 / 80 * (1 - 0.5 / segments**2)
    added = 0.1 * 9.81 * LENGTH**3 / 30 * (1 - 0.25 / segments**2)
    bare, loaded = (
        settled(arm, fidelity=fidelity, payload=payload).states()[0]
        for payload in (0.0, 0.1)
    )
    down = np.array([0.6, 0.8])
    np.testing.assert_allclose(bare[:2], own * down, rtol=1e-4, atol=1e-9)
    np.testing.assert_allclose(loaded[:2], (own + added) * down, rtol=1e-4, atol=1e-9)


def test_gravity_bends_a_standing_arm_further_and_straightens_a_hanging_one(make_arm):
    """The same pull, standing, without weight and hanging."""
    reach = []
    for upward in (-1.0, 0.0, 1.0):
        arm = make_arm(
            actuation="tension",
            gravity_direction=(0, 0, upward),
            module={"tension_range": 20.0},
        )
        reach.append(settled(arm, [[3.0, 0, 0]] * 3).states()[-1, 0])
    standing, weightless, hanging = reach
    assert standing > 1.05 * weightless > 1.05 * 1.05 * hanging > 0.05


def test_both_fidelities_agree_on_the_same_bent_arm(simulated):
    action = action_for(simulated, [[0.4, 0.1], [-0.2, 0.3], [0.1, -0.4]])
    fast, accurate = (
        settled(simulated, action, fidelity).states()[:, :3] for fidelity in FIDELITIES
    )
    assert np.linalg.norm(accurate[-1, :2]) > 0.05
    np.testing.assert_allclose(fast, accurate, atol=0.01 * simulated.length)


def test_the_accurate_chain_agrees_with_the_rod(make_arm):
    """Compare a chain of hinges with shooting along a rod."""
    arm = make_arm(
        actuation="tension", module={"tension_range": 20.0, "bending_stiffness": 0.3}
    )
    tensions = np.array([[6.0, 0, 2], [0, 5, 1], [3, 0, 4]])
    chain = settled(arm, tensions, "accurate").states()[:, :3]
    np.testing.assert_allclose(chain, rod_shape(arm, tensions)[:, :3], atol=0.002)
