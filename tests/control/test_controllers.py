"""Inverse PCC by hand, and the history of the network controller."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, ArmSpec, Module
from s2c2a.control import C2AOptions, InversePCC, NetworkController
from s2c2a.kinematics import PCC
from s2c2a.models import History


def an_arm(actuation, turns_deg, cables) -> ArmSpec:
    """An arm whose modules are turned against each other, with 20 N of pretension."""
    spread = 360.0 * np.arange(cables) / cables
    modules = [
        Module(
            length=0.2,
            cable_radius=0.027,
            cable_angles_deg=tuple(turn + spread),
            mass=0.075,
            bending_stiffness=0.35,
            pretension=20.0,
            tension_range=20.0,
        )
        for turn in turns_deg
    ]
    return ArmSpec(name="arm", actuation=actuation, modules=tuple(modules))


TWIN = an_arm("displacement", (0.0, 60.0, 0.0), 3)
SIMULATED = an_arm("tension", (0.0, 0.0, 0.0), 4)
start = eqx.filter_jit(lambda controller, sensed: controller.start(sensed))
act = eqx.filter_jit(lambda controller, *inputs: controller.act(*inputs))


def axes(*bends):
    """Configurations of bends given as (angle [rad], azimuth [rad])."""
    return np.array(
        [[np.sin(f) * np.cos(a), np.sin(f) * np.sin(a), np.cos(f)] for f, a in bends],
        np.float32,
    )


STRAIGHT = axes((0, 0), (0, 0), (0, 0))
BENT = axes((0.3, 0.5), (0.6, -2.0), (0.1, 1.2))


def inverse_pcc(arm, gains=(1.0, 1.0, 1.0)):
    return InversePCC(PCC.of(arm), jnp.array(gains))


def network_controller(arm, seed=0):
    return NetworkController(
        C2AOptions(layers=1, hidden=8).untrained(arm, jax.random.key(seed))
    )


def saturated(arm, towards):
    """A controller whose network has one constant, very large output."""
    controller = network_controller(arm)
    return eqx.tree_at(
        lambda c: c.network.network.bias_head, controller, 100.0 * jnp.asarray(towards)
    )


def drive(controller, sensed, desired):
    """Actions and memories over the steps, the first memory first."""
    memory = start(controller, sensed[0])
    actions, memories = [], [memory]
    for current, target in zip(sensed, desired, strict=True):
        action, memory = act(controller, target, current, memory)
        actions.append(np.asarray(action))
        memories.append(memory)
    return actions, memories


def displacements_by_hand(bends, turns, gains=(1, 1, 1)):
    """Minus radius times bend times the cosine between bend and cable."""
    rows = []
    for (angle, azimuth), turn, gain in zip(bends, turns, gains, strict=True):
        rows.append(
            [
                -0.027 * gain * angle * np.cos(azimuth - turn - cable)
                for cable in np.deg2rad([0, 120, 240])
            ]
        )
    return rows


def test_inverse_pcc_multiplies_each_module_by_its_gain():
    bends = [(0.3, 0.5), (0.6, -2.0), (0.1, 1.2)]
    gains = (1.1, 0.9, 1.5)
    action, _ = act(inverse_pcc(TWIN, gains), BENT, STRAIGHT, ())
    np.testing.assert_allclose(
        action, displacements_by_hand(bends, [0, np.pi / 3, 0], gains), atol=1e-7
    )


def test_inverse_pcc_has_no_feedback():
    controller = inverse_pcc(TWIN)
    assert start(controller, STRAIGHT) == ()
    one, other = (act(controller, BENT, sensed, ())[0] for sensed in (STRAIGHT, BENT))
    np.testing.assert_array_equal(one, other)


def test_inverse_pcc_pulls_towards_the_bend_on_a_tension_arm():
    """T_i = T0 + 2 EI f cos(psi - b_i) / (n r L)."""
    action, _ = act(
        inverse_pcc(SIMULATED), axes((0.2, 0.0), (0.2, np.pi / 2), (0, 0)), STRAIGHT, ()
    )
    pull = 2 * 0.35 * 0.2 / (4 * 0.027 * 0.2)
    by_hand = [[20 + pull, 20, 20 - pull, 20], [20, 20 + pull, 20, 20 - pull], [20] * 4]
    np.testing.assert_allclose(action, by_hand, rtol=1e-5)


@pytest.mark.parametrize("arm", [TWIN, SIMULATED])
def test_inverse_pcc_stays_within_the_limits_of_the_arm(arm):
    geometry = ArmGeometry.of(arm)
    action, _ = act(
        inverse_pcc(arm, (5.0, 5.0, 5.0)),
        axes((2.5, 0.1), (2.5, 2.0), (2.5, -2.0)),
        STRAIGHT,
        (),
    )
    assert (np.asarray(action) >= geometry.action_low - 1e-6).all()
    assert (np.asarray(action) <= geometry.action_high + 1e-6).all()


@pytest.mark.parametrize("arm", [TWIN, SIMULATED])
def test_the_history_starts_filled_with_the_first_values(arm):
    memory = start(network_controller(arm), BENT)
    np.testing.assert_array_equal(
        memory.configurations, np.repeat(BENT[:, None], 4, axis=1)
    )
    np.testing.assert_array_equal(memory.actions, np.zeros((3, 5, arm.cable_count)))


def test_the_history_holds_the_latest_first():
    random = np.random.default_rng(0)
    sensed, desired = random.normal(size=(2, 7, 3, 3)).astype(np.float32)
    controller = network_controller(TWIN)
    actions, memories = drive(controller, sensed, desired)
    normalized = [
        np.asarray(controller.network.sum_and_range.normalized(action))
        for action in actions
    ]
    for age in range(4):
        np.testing.assert_array_equal(
            memories[-1].configurations[:, age], sensed[6 - age]
        )
    for age in range(5):
        np.testing.assert_allclose(
            memories[-1].actions[:, age], normalized[6 - age], atol=1e-6
        )


def test_an_action_comes_from_the_configuration_just_sensed_and_the_actions_before():
    """Eq. (8): C_t to C_t-3 and A_t-1 to A_t-5."""
    sensed, desired = (
        np.random.default_rng(2).normal(size=(2, 4, 3, 3)).astype(np.float32)
    )
    controller = network_controller(TWIN)
    actions, memories = drive(controller, sensed, desired)
    configurations = np.stack([sensed[3], sensed[2], sensed[1], sensed[0]], axis=1)
    normalized = eqx.filter_jit(controller.network)(
        desired[3], History(jnp.asarray(configurations), memories[3].actions)
    )
    np.testing.assert_allclose(
        controller.network.sum_and_range.actions(normalized), actions[3], atol=1e-7
    )


@pytest.mark.parametrize("arm", [TWIN, SIMULATED])
def test_actions_of_a_saturated_network_stay_within_the_limits_of_the_arm(arm):
    controller = saturated(arm, [1.0] + [-1.0] * (arm.cable_count - 1))
    geometry = ArmGeometry.of(arm)
    action, _ = act(controller, BENT, STRAIGHT, start(controller, STRAIGHT))
    assert (np.asarray(action) >= geometry.action_low - 1e-6).all()
    assert (np.asarray(action) <= geometry.action_high + 1e-6).all()


def test_displacements_of_a_network_keep_the_length_of_every_module():
    """Eq. (1)."""
    sensed, desired = (
        np.random.default_rng(3).normal(size=(2, 3, 3, 3)).astype(np.float32)
    )
    actions, _ = drive(network_controller(TWIN), sensed, desired)
    np.testing.assert_allclose(np.sum(actions, axis=-1), 0.0, atol=1e-8)
