"""Attitude filters: the direction of gravity in the frames of inertial sensors."""

from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.measurements.repeats import RepeatDetector
from s2c2a.spaces import Reading

MAX_ACCELERATION = 500.0  # m/s2; common sensors measure up to 160
MAX_ANGULAR_VELOCITY = 100.0  # rad/s; common sensors measure up to 35
ACCELERATION_TIME = 1.0  # s; time constant of the accelerometer correction (VQF tauAcc)
SETTLING_TIME = 4.0  # s of repeated first samples; four times `ACCELERATION_TIME`


class Inclinometer:
    """Estimator of the direction of gravity at every module's end.

    It uses the filter VQF (Laidig and Seel 2023, Information Fusion 91), which also
    estimates the gyroscope biases.
    """

    def __init__(self, arm: ArmSpec):
        """Build the estimator for the inertial sensors of an arm.

        Raises:
            S2C2AError: the package vqf is not installed.
        """
        try:
            from vqf import VQF  # noqa: PLC0415  # an extra
        except ImportError as error:
            raise S2C2AError(
                "inertial sensors need the package vqf; install it, in your clone of "
                's2c2a, with `pip install ".[sensors]"`, or remove [sensors.imu] from '
                "the arm file"
            ) from error
        self._filter_class = VQF
        self._arm = arm
        self.reset()

    def reset(self) -> None:
        """Discard all attitudes and samples."""
        self._filters: list[Any] = []
        self._inclinations: Float[np.ndarray, "modules 3"] | None = None
        self._repeats = RepeatDetector()

    def inclinations(self, reading: Reading) -> Float[np.ndarray, "modules 3"] | None:
        """Unit vectors along gravity, each in its sensor's frame.

        Returns:
            Shape (modules, 3). None if the reading contains no valid samples; the last
            result if the samples are those of the last reading.
        """
        shape = (None, self._arm.module_count, 3)
        accelerations = reading.numbers("accelerations", shape)
        velocities = reading.numbers("angular_velocities", shape)
        if accelerations is None or velocities is None:
            return None
        if not len(accelerations) or accelerations.shape != velocities.shape:
            return None
        in_range = np.abs(accelerations) < MAX_ACCELERATION
        in_range &= np.abs(velocities) < MAX_ANGULAR_VELOCITY
        if not in_range.all():
            return None  # the filter would not recover from them
        if not self._repeats.is_repeated("accelerations", accelerations):
            if not self._filters:
                # start the filters, and repeat the first samples until they converge
                count = len(accelerations)
                repeats = round(SETTLING_TIME / self._arm.control_period) * count
                period = self._arm.control_period / count
                for module in range(accelerations.shape[1]):
                    started = self._filter_class(period, tauAcc=ACCELERATION_TIME)
                    mean = accelerations[:, module].mean(axis=0)
                    steady = np.tile(mean, (repeats, 1))
                    _down(started, steady, np.zeros_like(steady))
                    self._filters.append(started)
            self._inclinations = np.stack(
                [
                    _down(
                        attitude_filter, accelerations[:, module], velocities[:, module]
                    )
                    for module, attitude_filter in enumerate(self._filters)
                ]
            )
        return self._inclinations


def _down(
    attitude_filter: Any, accelerations: np.ndarray, velocities: np.ndarray
) -> Float[np.ndarray, "3"]:
    """Update a filter; returns the direction of gravity in the sensor's frame."""
    attitude_filter.updateBatch(
        np.ascontiguousarray(velocities), np.ascontiguousarray(accelerations)
    )
    w, x, y, z = attitude_filter.getQuat6D()
    return -np.array(
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    )
