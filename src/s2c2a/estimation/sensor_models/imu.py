"""Inertial sensors at the modules' ends, as inclinometers."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.estimation.sensor_models.base import (
    MAX_BEND_CHANGE,
    BiasPrior,
    ExpectedState,
    Innovation,
    Measurements,
    SensorModel,
    with_jacobian,
)
from s2c2a.kinematics import configurations_from_bends
from s2c2a.kinematics.chain import rotations_to
from s2c2a.models.forward_model import ForwardModel

INCLINATION_STD = 0.02  # rad; of an attitude filter on a moving arm
BIAS_STD = 0.01  # rad; of common accelerometers
BIAS_DRIFT = 1e-4  # rad; in one second


class ImuSensor(SensorModel):
    """Measures the direction of gravity at the end of every module (`Inclinometer`).

    Attributes:
        down: direction of gravity, base frame.
        modules: their number.
    """

    down: Float[Array, "3"]
    modules: int = eqx.field(static=True)
    name = "imu"

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel) -> "ImuSensor | None":
        if arm.sensors.imu is None or not any(arm.gravity_direction):
            return None
        down = jnp.asarray(arm.gravity_direction, jnp.float32)
        return cls(down, arm.module_count)

    @property
    def bias_prior(self) -> BiasPrior:
        values = 3 * self.modules
        return BiasPrior(jnp.full(values, BIAS_STD), jnp.full(values, BIAS_DRIFT))

    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        predicted, jacobian = with_jacobian(self._inclinations, expected.bends)
        residual = measurements["inclinations"].reshape(-1) - predicted
        std = jnp.full(predicted.shape, INCLINATION_STD)
        return Innovation(residual, jacobian, std, MAX_BEND_CHANGE)

    def missing(self) -> dict[str, np.ndarray]:
        return {"inclinations": np.full((self.modules, 3), np.nan, np.float32)}

    def _inclinations(self, bends: Float[Array, " bends"]) -> Float[Array, " values"]:
        """Gravity in the frame of every module's end, one after another."""
        down = self.down
        inclinations = []
        # a Python loop: an arm has few modules
        for rotation in rotations_to(configurations_from_bends(bends.reshape(-1, 2))):
            down = rotation.T @ down
            inclinations.append(down)
        return jnp.concatenate(inclinations)
