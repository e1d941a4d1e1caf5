"""Cable tensions from the motors' currents."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.estimation.sensor_models.base import (
    ExpectedState,
    Innovation,
    Measurements,
    SensorModel,
)
from s2c2a.models.forward_model import ForwardModel
from s2c2a.spaces import NOISE_LIMIT

MIN_NOISE = 0.05  # N; a sensor that claims less is not better than the model
MODEL_STD = 0.1  # rad; friction between motor and module hides most of the tension


class TensionSensor(SensorModel):
    """Measures how far taut cables are stretched.

    The tension of a taut cable is proportional to its stretch, which depends on the
    bend of its module. Friction masks the vibration, so tensions are compared with the
    equilibrium.

    Attributes:
        stiffness: tension per stretch over the cable radius [N/rad], shape
            (modules, 1).
        matrices: bend directions of the cables, shape (modules, cables, 2).
        noise: standard deviation of the tension [N].
    """

    stiffness: Float[Array, "modules 1"]
    matrices: Float[Array, "modules cables 2"]
    noise: float = eqx.field(static=True)
    name = "current"
    measures_equilibrium = True

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel) -> "TensionSensor | None":
        stiffness = model.cable_stiffnesses()
        if arm.motor.current_noise is None or stiffness is None:
            return None
        noise = max(arm.motor.current_noise, MIN_NOISE) + arm.motor.current_friction
        matrices = jnp.asarray(ArmGeometry.of(arm).cable_matrices, jnp.float32)
        return cls(jnp.asarray(stiffness, jnp.float32)[:, None], matrices, noise)

    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        modules = len(self.stiffness)
        stretch = jnp.einsum("mnk,mk->mn", self.matrices, expected.bend_biases)
        predicted = jnp.maximum(expected.tensions + self.stiffness * stretch, 0.0)
        measured = measurements["tensions"]
        taut = (measured > 2.0 * self.noise) | (predicted > 0.0)
        slopes = self.stiffness[..., None] * self.matrices * taut[..., None]
        jacobian = jnp.einsum("mnk,ml->mnlk", slopes, jnp.eye(modules))
        std = jnp.hypot(self.noise, self.stiffness * MODEL_STD)
        return Innovation(
            (measured - predicted).reshape(-1),
            jacobian.reshape(predicted.size, -1),
            jnp.broadcast_to(std, predicted.shape).reshape(-1),
            # no cable pushes, so that a negative tension is a fault or noise. Others may
            # change: a payload that is attached changes tensions as much as a fault
            # does, and the slack cables hide it from the filter at first
            max_change=jnp.where(
                jnp.min(measured) < -NOISE_LIMIT * self.noise, -1.0, jnp.inf
            ),
        )

    def missing(self) -> dict[str, np.ndarray]:
        return {"tensions": np.full(self.matrices.shape[:2], np.nan, np.float32)}
