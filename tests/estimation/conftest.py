"""What tests of sensor models share: expected states of an arm at rest."""

import jax.numpy as jnp
import pytest

from s2c2a.arm import ArmGeometry
from s2c2a.estimation.sensor_models import ExpectedState
from s2c2a.kinematics import states_from_bends

HISTORY = 9  # control steps


@pytest.fixture
def at_rest():
    """Builds the expected state of an arm that rests at given bends."""

    def build(arm, bends) -> ExpectedState:
        lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
        states = states_from_bends(bends, lengths)
        return ExpectedState(
            bends=bends,
            bend_biases=jnp.zeros_like(bends),
            tensions=jnp.full((arm.module_count, arm.cable_count), 5.0),
            past_bends=jnp.broadcast_to(bends, (HISTORY, *bends.shape)),
            past_sensed=jnp.broadcast_to(bends, (HISTORY, *bends.shape)),
            past_states=jnp.broadcast_to(states, (HISTORY, *states.shape)),
            bias_change=jnp.zeros((HISTORY, *bends.shape)),
        )

    return build
