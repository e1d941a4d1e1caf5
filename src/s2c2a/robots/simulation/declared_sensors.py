"""Sensor declarations of the simulated arm: shapes, units, plausible values."""

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import CENTER_LINE_POINTS, NOISE_LIMIT, Sensor

# Readings change faster than commands, since the arm vibrates and lags.
RATE_FACTOR = 6.0  # times the step limit


def declare_sensors(
    arm: ArmSpec, geometry: ArmGeometry, samples: int = 0
) -> dict[str, Sensor]:
    """Declare encoders, ground truth and motor currents.

    Plausible values follow from the cables' limits and the length of unit vectors.

    Args:
        arm: the description.
        geometry: its geometry.
        samples: samples of the center line in a control step; zero if not recorded.
    """
    modules = arm.module_count
    max_rate = RATE_FACTOR * geometry.step_limit * arm.control_rate
    noise = NOISE_LIMIT * arm.motor.measurement_noise(arm.actuation)
    scale = np.abs(geometry.action_scale)[:, None]
    rate = scale / geometry.action_bends[:, None] * max_rate
    margin = 0.25 * scale + noise
    # a quarter of the range plus noise beyond the limits is still plausible
    cables = Sensor(
        geometry.action_neutral.shape,
        arm.unit,
        low=geometry.action_low - margin,
        high=geometry.action_high + margin,
        fastest=rate + noise * arm.control_rate,
    )
    sensors = {
        "cables": cables,
        "states": Sensor((modules, 6), "m, 1"),
        "configurations": Sensor((modules, 3), "1", -1.01, 1.01, max_rate),
    }
    if arm.motor.current_noise is not None:
        sensors["tensions"] = Sensor((modules, arm.cable_count), "N")
    if samples:
        points = modules * CENTER_LINE_POINTS
        sensors["center_line"] = Sensor((samples, points, 3), "m")
    return sensors
