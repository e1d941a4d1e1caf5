"""Bends of every module, from motion capture of all ends or from simulation."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.estimation.sensor_models.base import (
    MAX_BEND_CHANGE,
    ExpectedState,
    Innovation,
    Measurements,
    SensorModel,
)
from s2c2a.kinematics import bends_from_configurations
from s2c2a.models.forward_model import ForwardModel

BEND_STD = 0.003  # rad: half a millimeter over a module of 0.2 m


class BendSensor(SensorModel):
    """Measures the bends of all modules at the rate of the control loop.

    Attributes:
        modules: their number.
    """

    modules: int = eqx.field(static=True)
    name = "bends"

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel) -> "BendSensor | None":
        if arm.sensing == "true" or arm.sensors.bends:
            return cls(arm.module_count)
        return None

    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        measured = bends_from_configurations(measurements["configurations"])
        residual = (measured - expected.bends).reshape(-1)
        values = residual.size
        std = jnp.full(values, BEND_STD)
        # no `max_change`: an external force changes bends as suddenly as a fault does
        return Innovation(residual, jnp.eye(values), std, MAX_BEND_CHANGE)

    @property
    def value_count(self) -> int:
        return 2 * self.modules

    def missing(self) -> dict[str, np.ndarray]:
        return {"configurations": np.full((self.modules, 3), np.nan, np.float32)}
