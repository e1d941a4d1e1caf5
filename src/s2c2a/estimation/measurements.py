"""Measurements of a filter from readings.

Missing, invalid and repeated values become NaN.
"""

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.estimation.attitude import Inclinometer
from s2c2a.estimation.sensor_models import SensorModel
from s2c2a.kinematics import configurations_from_states
from s2c2a.measurements.repeats import RepeatDetector
from s2c2a.spaces import Reading


def missing_values(sensors: tuple[SensorModel, ...]) -> dict[str, np.ndarray]:
    """NaN in the shape of every value that the sensors measure, by its name."""
    missing: dict[str, np.ndarray] = {}
    for sensor in sensors:
        missing |= sensor.missing()
    return missing


class MeasurementReader:
    """Reads the measurements of all sensor models from readings."""

    def __init__(self, arm: ArmSpec, sensors: tuple[SensorModel, ...]):
        """Build the reader for the sensors of an arm."""
        self._missing = missing_values(sensors)
        needs_inclinations = "inclinations" in self._missing
        self._inclinometer = Inclinometer(arm) if needs_inclinations else None
        self.reset()

    def reset(self) -> None:
        """Discard all earlier readings, after the robot was opened again."""
        self._repeats = RepeatDetector()
        if self._inclinometer is not None:
            self._inclinometer.reset()

    def measurements(self, reading: Reading) -> dict[str, np.ndarray]:
        """Measured values in single precision, by name; NaN where they are missing."""
        return {
            name: self._measurement(name, missing, reading)
            for name, missing in self._missing.items()
        }

    def _measurement(
        self, name: str, missing: np.ndarray, reading: Reading
    ) -> np.ndarray:
        values = self._values(name, missing.shape, reading)
        if values is None:
            return missing
        with np.errstate(over="ignore"):  # a value too large for it becomes infinite
            values = values.astype(np.float32)
        # a single number, such as an age, may repeat
        if self._repeats.is_repeated(name, values) and values.ndim:
            return missing
        return values

    def _values(
        self, name: str, shape: tuple[int, ...], reading: Reading
    ) -> np.ndarray | None:
        if name == "inclinations" and self._inclinometer is not None:
            return self._inclinometer.inclinations(reading)
        if name == "configurations" and reading.get(name) is None:
            states = reading.numbers("states", (shape[0], 6))
            return None if states is None else configurations_from_states(states)
        return reading.numbers(name, shape)
