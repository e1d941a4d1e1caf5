"""What a load does to the chain: by hand for one module, nothing without a load, and what the simulated arm does."""

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

given = eqx.filter_jit(
    lambda model, disturbances, sensed, memory: model.given(
        disturbances, sensed, memory
    )
)
predict = eqx.filter_jit(lambda model, sensed, memory: model.predict(sensed, memory))


def loaded(kilograms, modules=3) -> Disturbances:
    return Disturbances(jnp.asarray(kilograms, jnp.float32), jnp.zeros((modules, 2)))


def test_a_weight_beside_the_base_bends_a_module_by_its_lever():
    """A straight module that lies: the weight's moment about its middle is half its length times the weight."""
    down = jnp.array([GRAVITY, 0.0, 0.0])
    found = moments_of_weights(
        jnp.array([0.1]), jnp.zeros((1, 2)), jnp.array([0.2]), jnp.array([1.5]), down
    )
    np.testing.assert_allclose(found, [[1.5 * 0.1 * GRAVITY * 0.1, 0.0]], rtol=1e-4)


def test_an_end_gives_way_across_and_not_along():
    straight, lengths, gives = jnp.zeros((1, 2)), jnp.array([0.2]), jnp.array([0.004])
    off = jnp.zeros(3)
    across = states_from_arcs(straight, lengths, off, jnp.array([2.0, 0.0, 0.0]), gives)
    along = states_from_arcs(straight, lengths, off, jnp.array([0.0, 0.0, 2.0]), gives)
    np.testing.assert_allclose(across[0, :3], [0.008, 0.0, 0.2], atol=1e-7)
    np.testing.assert_allclose(along[0, :3], [0.0, 0.0, 0.2], atol=1e-7)


@pytest.mark.parametrize("sensing", ["encoders", "true"])
def test_no_load_and_no_lean_change_nothing(sensing):
    arm = load_arm("twin_arm").model_copy(update={"sensing": sensing})
    model = ChainOptions(hidden=8, depth=1).untrained(arm, jax.random.key(0))
    sensed = configurations_from_bends(
        jnp.asarray(np.random.default_rng(0).normal(0, 0.3, (3, 2)), jnp.float32)
    )
    memory = model.start(sensed)
    np.testing.assert_allclose(
        predict(model, sensed, given(model, loaded(0.0), sensed, memory)),
        predict(model, sensed, memory),
        atol=1e-6,
    )


def test_leans_are_bends_beside_those_that_are_expected():
    model = shipped_networks(load_arm("twin_arm")).c2s
    sensed = configurations_from_bends(jnp.full((3, 2), 0.2))
    memory, leans = (
        model.start(sensed),
        jnp.array([[0.05, 0.0], [0.0, 0.02], [0.0, 0.0]]),
    )
    leant = given(model, Disturbances(jnp.zeros(()), leans), sensed, memory)
    bends = [
        bends_from_configurations(
            configurations_from_states(predict(model, sensed, one))
        )
        for one in (memory, leant)
    ]
    np.testing.assert_allclose(bends[1] - bends[0], leans, atol=2e-3)


def test_a_model_trained_without_load_knows_where_a_weight_leads():
    """Held poses of the twin with 50 g: told of them, it is three times nearer than without."""
    arm = load_arm("twin_arm")
    model, geometry = shipped_networks(arm).c2s, ArmGeometry.of(arm)
    off = {0.0: [], 0.05: []}
    for seed in range(4):
        shares = np.random.default_rng(seed).uniform(-0.45, 0.45, (3, 2))
        robot = SimulatedRobot(arm, payload=0.05)
        robot.open()
        for step in range(100):
            robot.step(geometry.actions_at(shares * min(1.0, step / 30)))
        sensed = configurations_from_bends(
            jnp.asarray(shares * geometry.bend_limits[:, None], jnp.float32)
        )
        for told, errors in off.items():
            memory = model.start(sensed)
            for _ in range(5):
                memory = given(model, loaded(told), sensed, memory)
            errors.append(
                np.linalg.norm(
                    np.asarray(predict(model, sensed, memory))[-1, :3]
                    - robot.states()[-1, :3]
                )
            )
    assert np.mean(off[0.05]) < np.mean(off[0.0]) / 3
