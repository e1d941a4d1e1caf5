"""Payload and bend biases in the chain model: mechanics by hand, limits, and the simulated arm."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.arm.spec import GRAVITY
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    configurations_from_states,
)
from s2c2a.kinematics.chain import states_from_arcs
from s2c2a.models import ChainOptions
from s2c2a.models.disturbances import Disturbances, moments_of_weights
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import shipped_networks

from marks import slow_after


@eqx.filter_jit
def with_moments(model, disturbances, sensed, memory, before):
    return model.with_moments(disturbances, sensed, memory, before)


@eqx.filter_jit
def predict(model, sensed, memory, disturbances=None):
    return model.predict(sensed, memory, disturbances)


def settled(model, disturbances, sensed, memory, steps=5) -> Disturbances:
    """Disturbances whose payload moments have converged at a configuration."""
    none = Disturbances.none(len(sensed))
    before = disturbances._replace(
        moments=none.moments, moments_per_kg=none.moments_per_kg
    )
    for _ in range(steps):
        before = with_moments(model, disturbances, sensed, memory, before)
    return before


def payload_of(kilograms, modules=3) -> Disturbances:
    return Disturbances(jnp.asarray(kilograms, jnp.float32), jnp.zeros((modules, 2)))


@pytest.mark.slow
def test_a_weight_beside_the_base_bends_a_module_by_its_lever():
    """A straight horizontal module: the moment about its middle is m g L / 2."""
    down = jnp.array([GRAVITY, 0.0, 0.0])
    found = moments_of_weights(
        jnp.array([0.1]), jnp.zeros((1, 2)), jnp.array([0.2]), jnp.array([1.5]), down
    )
    np.testing.assert_allclose(found, [[1.5 * 0.1 * GRAVITY * 0.1, 0.0]], rtol=1e-4)


def test_an_end_gives_way_across_and_not_along():
    straight = jnp.zeros((1, 2))
    lengths = jnp.array([0.2])
    off = jnp.zeros(3)
    across, along = (
        states_from_arcs(straight, lengths, off, jnp.array(force), jnp.array([0.004]))
        for force in ([2.0, 0.0, 0.0], [0.0, 0.0, 2.0])
    )
    np.testing.assert_allclose(across[0, :3], [0.008, 0.0, 0.2], atol=1e-7)
    np.testing.assert_allclose(along[0, :3], [0.0, 0.0, 0.2], atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("sensing", ["encoders", "true"])
def test_no_payload_and_no_bias_change_nothing(sensing):
    arm = load_arm("twin_arm").model_copy(update={"sensing": sensing})
    model = ChainOptions(hidden=8, depth=1).untrained(arm, jax.random.key(0))
    bends = np.random.default_rng(0).normal(0, 0.3, (3, 2))
    sensed = configurations_from_bends(jnp.asarray(bends, jnp.float32))
    memory = model.start(sensed)
    none = settled(model, payload_of(0.0), sensed, memory)
    np.testing.assert_allclose(
        predict(model, sensed, memory, none), predict(model, sensed, memory), atol=1e-6
    )


@pytest.mark.slow
def test_bend_biases_are_added_to_the_predicted_bends():
    model = shipped_networks(load_arm("twin_arm")).c2s
    sensed = configurations_from_bends(jnp.full((3, 2), 0.2))
    memory = model.start(sensed)
    biases = jnp.array([[0.05, 0.0], [0.0, 0.02], [0.0, 0.0]])
    biased = Disturbances.none(3)._replace(bend_biases=biases)
    bends = [
        bends_from_configurations(
            configurations_from_states(predict(model, sensed, memory, disturbances))
        )
        for disturbances in (None, biased)
    ]
    np.testing.assert_allclose(bends[1] - bends[0], biases, atol=2e-3)


@pytest.mark.slow
def test_moments_follow_a_changed_payload_in_proportion():
    model = shipped_networks(load_arm("twin_arm")).c2s
    sensed = configurations_from_bends(jnp.full((3, 2), 0.2))
    memory = model.start(sensed)
    light = settled(model, payload_of(0.04), sensed, memory, steps=20)
    heavy = settled(model, payload_of(0.05), sensed, memory, steps=20)
    np.testing.assert_allclose(
        light.with_payload(jnp.asarray(0.05)).moments, heavy.moments, atol=0.02
    )


@pytest.mark.parametrize(
    ("kilograms", "most"), slow_after(1, [(0.1, 0.8), (0.05, 1.0)])
)
def test_gains_are_the_change_of_a_loaded_arm_that_has_settled(kilograms, most):
    """With 100 g, bends change by a quarter more than under constant moments, or further."""
    model = shipped_networks(load_arm("twin_arm")).c2s
    bends = jnp.array([[0.0, 0.0], [0.2, 0.1], [0.35, 0.1]])

    def prediction(change, disturbances):
        sensed = configurations_from_bends(bends + change)
        memory = model.start(sensed)
        if disturbances is None:
            disturbances = settled(model, payload_of(kilograms), sensed, memory, 30)
        states = predict(model, sensed, memory, disturbances)
        return bends_from_configurations(configurations_from_states(states))

    sensed = configurations_from_bends(bends)
    memory = model.start(sensed)
    constant = settled(model, payload_of(kilograms), sensed, memory, steps=30)
    changing = eqx.filter_jit(lambda *at: model.with_gains(*at))(
        constant, sensed, memory
    )
    change = jnp.array([[0.03, 0.0], [0.0, 0.0], [0.0, 0.0]])
    there, without, expected = (
        np.asarray(prediction(change, loads) - prediction(0.0, loads))
        for loads in (changing, constant, None)
    )
    np.testing.assert_allclose(there, expected, atol=0.15 * np.abs(expected).max())
    assert np.linalg.norm(without) < most * np.linalg.norm(expected)


@pytest.mark.slow
def test_a_model_trained_without_payload_predicts_its_effect():
    """Poses of the twin with 50 g: three times nearer with the payload than without."""
    arm = load_arm("twin_arm")
    model = shipped_networks(arm).c2s
    geometry = ArmGeometry.of(arm)
    errors = {0.0: [], 0.05: []}
    for seed in range(4):
        shares = np.random.default_rng(seed).uniform(-0.45, 0.45, (3, 2))
        robot = SimulatedRobot(arm, payload=0.05)
        robot.open()
        for step in range(100):
            robot.step(geometry.actions_at(shares * min(1.0, step / 30)))
        bends = shares * geometry.bend_limits[:, None]
        sensed = configurations_from_bends(jnp.asarray(bends, jnp.float32))
        memory = model.start(sensed)
        tip = robot.states()[-1, :3]
        for payload in errors:
            known = settled(model, payload_of(payload), sensed, memory, steps=15)
            predicted = np.asarray(predict(model, sensed, memory, known))[-1, :3]
            errors[payload].append(np.linalg.norm(predicted - tip))
    assert np.mean(errors[0.05]) < np.mean(errors[0.0]) / 3
