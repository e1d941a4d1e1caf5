"""Inverse PCC by hand, and the history of the network controller."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.control import C2AOptions, InversePCC, NetworkController
from s2c2a.kinematics import PCC
from s2c2a.models import History

TWIN = load_arm("twin_arm")
SIMULATED = load_arm("simulated_arm")
start = eqx.filter_jit(lambda controller, sensed: controller.start(sensed))
act = eqx.filter_jit(lambda controller, *inputs: controller.act(*inputs))


def axes(*bends):
    """Configurations of bends given as (angle [rad], azimuth [rad])."""
    angles, azimuths = np.transpose(bends)
    aside = np.sin(angles) * [np.cos(azimuths), np.sin(azimuths)]
    return np.float32([*aside, np.cos(angles)]).T


STRAIGHT = axes((0, 0), (0, 0), (0, 0))
BENT = axes((0.3, 0.5), (0.6, -2.0), (0.1, 1.2))


def inverse_pcc(arm, gains=(1.0, 1.0, 1.0)):
    return InversePCC(PCC.of(arm), jnp.array(gains))


def network_controller(arm, seed=0):
    options = C2AOptions(layers=1, hidden=8)
    return NetworkController(options.untrained(arm, jax.random.key(seed)))


def saturated(arm, towards):
    """A controller whose network has one constant, very large output."""
    bias = 100.0 * jnp.asarray(towards)
    controller = network_controller(arm)
    return eqx.tree_at(lambda c: c.network.network.bias_head, controller, bias)


def driven(controller, steps):
    """Random inputs, and actions and memories over the steps, the first memory first."""
    random = np.random.default_rng(0)
    sensed, desired = random.normal(size=(2, steps, 3, 3)).astype(np.float32)
    memory = start(controller, sensed[0])
    actions, memories = [], [memory]
    for current, target in zip(sensed, desired, strict=True):
        action, memory = act(controller, target, current, memory)
        actions.append(np.asarray(action))
        memories.append(memory)
    return sensed, desired, actions, memories


def displacements_by_hand(bends, turns, gains):
    """Minus radius times bend times the cosine between bend and cable."""
    angles, azimuths = np.transpose(bends)[..., None]
    cables = np.deg2rad([0, 120, 240]) + np.transpose([turns])
    return -0.027 * np.transpose([gains]) * angles * np.cos(azimuths - cables)


def test_inverse_pcc_multiplies_each_module_by_its_gain():
    bends = [(0.3, 0.5), (0.6, -2.0), (0.1, 1.2)]
    gains = (1.1, 0.9, 1.5)
    action, _ = act(inverse_pcc(TWIN, gains), BENT, STRAIGHT, ())
    expected = displacements_by_hand(bends, [0, np.pi / 3, 0], gains)
    np.testing.assert_allclose(action, expected, atol=1e-7)


def test_inverse_pcc_has_no_feedback():
    controller = inverse_pcc(TWIN)
    assert start(controller, STRAIGHT) == ()
    one, other = (act(controller, BENT, sensed, ())[0] for sensed in (STRAIGHT, BENT))
    np.testing.assert_array_equal(one, other)


def test_inverse_pcc_pulls_towards_the_bend_on_a_tension_arm():
    """T_i = T0 + 2 EI f cos(psi - b_i) / (n r L)."""
    desired = axes((0.2, 0.0), (0.2, np.pi / 2), (0, 0))
    action, _ = act(inverse_pcc(SIMULATED), desired, STRAIGHT, ())
    pull = 2 * 0.4 * 0.2 / (4 * 0.027 * 0.2)
    by_hand = [[27 + pull, 27, 27 - pull, 27], [27, 27 + pull, 27, 27 - pull], [27] * 4]
    np.testing.assert_allclose(action, by_hand, rtol=1e-5)


@pytest.mark.parametrize("arm", [TWIN, SIMULATED])
def test_the_history_starts_filled_with_the_first_values(arm):
    memory = start(network_controller(arm), BENT)
    filled = np.repeat(BENT[:, None], 4, axis=1)
    np.testing.assert_array_equal(memory.configurations, filled)
    np.testing.assert_array_equal(memory.actions, np.zeros((3, 5, arm.cable_count)))


def test_the_history_holds_the_latest_first():
    controller = network_controller(TWIN)
    sensed, _, actions, memories = driven(controller, 7)
    latest = np.swapaxes(sensed[:2:-1], 0, 1)
    np.testing.assert_array_equal(memories[-1].configurations, latest)
    normalized = map(controller.network.sum_and_range.normalized, actions[:1:-1])
    latest = np.stack(list(normalized), axis=1)
    np.testing.assert_allclose(memories[-1].actions, latest, atol=1e-6)


def test_an_action_comes_from_the_configuration_just_sensed_and_the_actions_before():
    """Eq. (8): C_t to C_t-3 and A_t-1 to A_t-5."""
    controller = network_controller(TWIN)
    sensed, desired, actions, memories = driven(controller, 4)
    latest = jnp.stack(sensed[::-1], axis=1)
    history = History(latest, memories[3].actions)
    normalized = eqx.filter_jit(controller.network)(desired[3], history)
    expected = controller.network.sum_and_range.actions(normalized)
    np.testing.assert_allclose(expected, actions[3], atol=1e-7)


@pytest.mark.parametrize("arm", [TWIN, SIMULATED])
def test_actions_stay_within_the_limits_of_the_arm(arm):
    network = saturated(arm, [1.0] + [-1.0] * (arm.cable_count - 1))
    far = axes((2.5, 0.1), (2.5, 2.0), (2.5, -2.0))
    geometry = ArmGeometry.of(arm)
    for controller in (network, inverse_pcc(arm, (5.0, 5.0, 5.0))):
        action, _ = act(controller, far, STRAIGHT, start(controller, STRAIGHT))
        assert (np.asarray(action) >= geometry.action_low - 1e-6).all()
        assert (np.asarray(action) <= geometry.action_high + 1e-6).all()


def test_displacements_of_a_network_keep_the_length_of_every_module():
    """Eq. (1)."""
    _, _, actions, _ = driven(network_controller(TWIN), 3)
    np.testing.assert_allclose(np.sum(actions, axis=-1), 0.0, atol=1e-8)
