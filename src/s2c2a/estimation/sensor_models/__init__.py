"""Sensor models: one file each, found by the arm file."""

from collections.abc import Mapping
from typing import Any

from s2c2a.arm import ArmSpec
from s2c2a.estimation.sensor_models.base import (
    BiasPrior,
    ExpectedState,
    FormulaSensor,
    Innovation,
    Measurements,
    SensorModel,
    interpolated,
    with_jacobian,
)
from s2c2a.estimation.sensor_models.bends import BendSensor
from s2c2a.estimation.sensor_models.camera import CameraSensor
from s2c2a.estimation.sensor_models.imu import ImuSensor
from s2c2a.estimation.sensor_models.learned import (
    PREFIX,
    LearnedSensor,
    SensorNetwork,
    learned_sensors,
    untrained_sensors,
)
from s2c2a.estimation.sensor_models.tension import TensionSensor
from s2c2a.estimation.sensor_models.training import SensorSamples, train_sensor
from s2c2a.models.forward_model import ForwardModel
from s2c2a.plugins.components import Registry

SENSOR_MODELS: tuple[type[SensorModel], ...] = (
    BendSensor,
    ImuSensor,
    TensionSensor,
    CameraSensor,
)
"""Sensor models of the package, in the order of their filter updates."""
FORMULAS: Registry[FormulaSensor] = Registry("sensor_model", FormulaSensor, {})
"""Formulas of the user's own sensors, which the arm file names."""


def sensor_models_of(
    arm: ArmSpec, model: ForwardModel, networks: Mapping[str, Any]
) -> tuple[SensorModel, ...]:
    """All sensors of an arm beside its encoders, by its arm file.

    Args:
        arm: the arm.
        model: its forward model.
        networks: of its strategy, among them those of learned sensors.

    Raises:
        S2C2AError: the arm file names a sensor model that is not found.
    """
    candidates = [kind.of(arm, model) for kind in SENSOR_MODELS]
    known = [sensor for sensor in candidates if sensor is not None]
    formulas = [
        FORMULAS.find(raw.model)(raw.name, raw.shape)
        for raw in arm.sensors.raw
        if raw.model
    ]
    return (*known, *formulas, *learned_sensors(arm, networks))
