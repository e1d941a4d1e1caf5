"""Response predicted by models, for comparison with a measured response."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation.modal_model import (
    LinearizedArm,
    ModalFactors,
    ModalStep,
    modal_step,
    simulate,
)
from s2c2a.kinematics import bends_from_states
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.lab.response.excitation import tilts
from s2c2a.models.forward_model import ForwardModel

BendSeries = Float[np.ndarray, "steps modules 2"]


def modes(step: ModalStep, period: float) -> Float[np.ndarray, "modes 2"]:
    """Frequencies [Hz] and damping ratios, slowest first."""
    poles = np.log(np.linalg.eigvals(step.transition).astype(complex)) / period
    poles = poles[np.argsort(np.abs(poles))]
    poles = poles[poles.imag >= 0]
    sizes = np.abs(poles)
    ratios = -poles.real / np.maximum(sizes, 1e-12)
    return np.stack([sizes / (2.0 * np.pi), ratios], axis=-1)


def expected_tilts(
    arm: ArmSpec, factors: ModalFactors, equilibria: BendSeries
) -> Float[np.ndarray, "steps 2"]:
    """Tilts of the tip towards x and y [rad] of an arm that vibrates.

    Args:
        arm: without payload.
        factors: of its modal model.
        equilibria: bends at rest, step by step [rad].
    """
    step = modal_step(LinearizedArm.of(arm), factors, arm.control_period)
    flat = equilibria.reshape(1, len(equilibria), -1)
    bends = simulate(step, flat)[0].reshape(equilibria.shape)
    lengths = jnp.asarray([module.length for module in arm.modules], jnp.float32)
    states = states_from_bends(jnp.asarray(bends, jnp.float32), lengths)
    return tilts(np.asarray(states, float))


def equilibria_by_description(
    arm: ArmSpec, factors: ModalFactors, motor_bends: BendSeries
) -> BendSeries:
    """Bends at rest of a straight, taut arm: its cables stretch, and it sags.

    Args:
        arm: without payload.
        factors: of its modal model.
        motor_bends: bends that the motors' positions stand for [rad].
    """
    linearized = LinearizedArm.of(arm)
    step = modal_step(linearized, factors, arm.control_period)
    stiffnesses = [module.bending_stiffness / module.length for module in arm.modules]
    elastic = np.repeat(stiffnesses, 2)
    if arm.actuation != "displacement":
        cable_stiffness = elastic
    else:
        cable_stiffness = linearized.stiffnesses - elastic
    flat = motor_bends.reshape(len(motor_bends), -1)
    moments = float(factors.stiffness) * cable_stiffness * flat
    return np.linalg.solve(step.stiffness, moments.T).T.reshape(motor_bends.shape)


def equilibria_by_model(
    model: ForwardModel, sensed: Float[np.ndarray, "steps modules 3"]
) -> BendSeries:
    """Bends at rest that a forward model predicts for sensed configurations."""
    return np.asarray(_equilibria(model, jnp.asarray(sensed, jnp.float32)), float)


@eqx.filter_jit
def _equilibria(
    model: ForwardModel, sensed: Float[Array, "steps modules 3"]
) -> Float[Array, "steps modules 2"]:
    def step(memory: Any, configuration: Array) -> tuple[Any, Array]:
        memory = model.observe(configuration, memory)
        return memory, bends_from_states(model.predict(configuration, memory))

    return jax.lax.scan(step, model.start(sensed[0]), sensed)[1]
