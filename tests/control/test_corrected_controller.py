"""Integral feedback around another controller: convergence, limit and memory."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.control import CorrectedController, InversePCC
from s2c2a.kinematics import PCC, bends_from_configurations, configurations_from_bends

TWIN = load_arm("twin_arm")
MAP = PCC.of(TWIN)
INNER = InversePCC(MAP, jnp.ones(3))
DESIRED = np.array([[0.3, 0.1], [-0.2, 0.25], [0.0, 0.4]], np.float32)
OFFSET = np.array([[0.05, 0.0], [0.0, -0.04], [0.03, 0.03]], np.float32)
STRAIGHT = np.zeros((3, 2), np.float32)
act = eqx.filter_jit(lambda controller, *inputs: controller.act(*inputs))


def axes(bends):
    return configurations_from_bends(jnp.asarray(bends, dtype=jnp.float32))


def drive(controller, plant, desired):
    """Bends and integrals over the steps; `plant` maps bends of the cables to bends."""
    bends = STRAIGHT
    memory = controller.start(axes(STRAIGHT))
    reached = []
    offsets = []
    for target in desired:
        action, memory = act(controller, axes(target), axes(bends), memory)
        bends = plant(np.asarray(MAP.bends(action)))
        reached.append(bends)
        offsets.append(np.asarray(memory.offset))
    return np.array(reached), np.array(offsets)


def test_a_constant_offset_is_integrated_away():
    """The error shrinks by 1 - gain in a step."""
    controller = CorrectedController(INNER, 0.2)
    reached, offsets = drive(controller, lambda bends: bends + OFFSET, [DESIRED] * 60)
    np.testing.assert_allclose(reached[0] - DESIRED, OFFSET, atol=1e-5)
    np.testing.assert_allclose(reached[10] - DESIRED, 0.8**10 * OFFSET, atol=1e-4)
    np.testing.assert_allclose(reached[-1], DESIRED, atol=1e-4)
    np.testing.assert_allclose(offsets[-1], -OFFSET, atol=1e-4)


@pytest.mark.parametrize("largest", [0.1, 0.02])
def test_the_integral_never_exceeds_its_limit(largest):
    """A plant that does not move at all."""
    controller = CorrectedController(INNER, 0.5, largest)
    _, offsets = drive(controller, np.zeros_like, [DESIRED] * 50)
    lengths = np.linalg.norm(offsets, axis=-1)
    assert lengths.max() <= largest + 1e-6
    np.testing.assert_allclose(lengths[-1], largest, atol=1e-6)
    directions = DESIRED / np.linalg.norm(DESIRED, axis=-1, keepdims=True)
    np.testing.assert_allclose(offsets[-1], largest * directions, atol=1e-5)


def test_an_integral_at_its_limit_falls_as_soon_as_the_error_changes_sign():
    controller = CorrectedController(INNER, 0.2)
    memory = controller.start(axes(STRAIGHT))
    for _ in range(50):
        _, memory = act(controller, axes(DESIRED), axes(STRAIGHT), memory)
    _, after = act(controller, axes(DESIRED), axes(2 * DESIRED), memory)
    before = np.linalg.norm(memory.offset, axis=-1)
    assert (np.linalg.norm(after.offset, axis=-1) < before - 0.01).all()


def test_without_an_error_the_action_is_that_of_the_inner_controller():
    """A plant that follows exactly, along a path."""
    controller = CorrectedController(INNER, 0.2)
    sensed = STRAIGHT
    memory = controller.start(axes(sensed))
    for share in np.linspace(0.1, 1.0, 10):
        desired = share * DESIRED
        action, memory = act(controller, axes(desired), axes(sensed), memory)
        expected, _ = INNER.act(axes(desired), axes(sensed), ())
        np.testing.assert_allclose(action, expected, atol=1e-7)
        np.testing.assert_allclose(memory.offset, 0.0, atol=1e-5)
        sensed = desired


def test_the_initial_error_is_zero_at_any_configuration():
    controller = CorrectedController(INNER, 0.2)
    bent = axes(DESIRED + 0.3)
    _, memory = act(controller, axes(DESIRED), bent, controller.start(bent))
    np.testing.assert_allclose(memory.offset, 0.0, atol=1e-6)


def test_the_error_uses_the_desired_bends_of_the_last_step():
    """A plan that moves on causes no error."""
    controller = CorrectedController(INNER, 0.2)
    desired = [0.05 * step * DESIRED for step in range(20)]
    reached, offsets = drive(controller, lambda bends: bends, desired)
    np.testing.assert_allclose(offsets, 0.0, atol=1e-5)
    np.testing.assert_allclose(reached[-1], 0.95 * DESIRED, atol=1e-5)


def test_the_memory_of_the_inner_controller_is_kept():
    class Counter(InversePCC):
        def start(self, sensed):
            return jnp.zeros(())

        def act(self, desired, sensed, memory):
            return jnp.sum(bends_from_configurations(desired)), memory + 1.0

    controller = CorrectedController(Counter(MAP, jnp.ones(3)), 0.2)
    memory = controller.start(axes(STRAIGHT))
    for _ in range(3):
        _, memory = act(controller, axes(DESIRED), axes(DESIRED), memory)
    assert float(memory.inner) == 3.0
