"""How a tip would answer what its motors did, by what is known of the arm: the other column of a measured response."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation.excitation import tilts
from s2c2a.estimation.modal_model import Body, Motion, Swing, followed, motion
from s2c2a.kinematics import bends_from_states
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.models.forward_model import ForwardModel

Felt = Float[np.ndarray, "steps modules 2"]


def expected_tilts(
    arm: ArmSpec, swing: Swing, rests: Felt
) -> Float[np.ndarray, "steps 2"]:
    """Tilts of the tip towards x and y [rad] of an arm that swings about where it would rest.

    Args:
        arm: the arm, without a load.
        swing: how it swings.
        rests: bends at which it would rest, step by step [rad].
    """
    swinging = motion(Body.of(arm), swing, 0.0, arm.control_period)
    bends = followed(swinging, rests.reshape(1, len(rests), -1))[0].reshape(rests.shape)
    lengths = jnp.asarray([module.length for module in arm.modules], jnp.float32)
    return tilts(
        np.asarray(states_from_bends(jnp.asarray(bends, jnp.float32), lengths), float)
    )


def rests_by_description(arm: ArmSpec, swing: Swing, felt: Felt) -> Felt:
    """Bends at which a straight, taut arm would rest where its motors are so: cables stretch, and it sinks.

    Args:
        arm: the arm, without a load.
        swing: its factor of stiffness.
        felt: bends that motors ask for [rad].
    """
    body = Body.of(arm)
    swinging: Motion = motion(body, swing, 0.0, arm.control_period)
    elastic = np.repeat(
        [module.bending_stiffness / module.length for module in arm.modules], 2
    )
    pulls = elastic if arm.actuation == "tension" else body.springs - elastic
    asked = float(swing.stiffness) * pulls * felt.reshape(len(felt), -1)
    return np.linalg.solve(swinging.springs, asked.T).T.reshape(felt.shape)


def rests_by_model(
    model: ForwardModel, sensed: Float[np.ndarray, "steps modules 3"]
) -> Felt:
    """Bends at which a forward model says that the arm would rest, for configurations that were sensed in turn."""
    return np.asarray(_rests(model, jnp.asarray(sensed, jnp.float32)), float)


@eqx.filter_jit
def _rests(
    model: ForwardModel, sensed: Float[Array, "steps modules 3"]
) -> Float[Array, "steps modules 2"]:
    def step(memory: Any, now: Array) -> tuple[Any, Array]:
        memory = model.observe(now, memory)
        return memory, bends_from_states(model.predict(now, memory))

    return jax.lax.scan(step, model.start(sensed[0]), sensed)[1]
