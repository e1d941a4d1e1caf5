"""What the simulated arm declares of its sensors: shapes, units, plausible numbers."""

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.robots.simulation.transmission import tick_length
from s2c2a.spaces import CENTER_LINE_POINTS, Sensor

# times the step limit: what readings may change by, since the arm swings and lags
TURNS_A_STEP = 6.0
NOISE = 8.0  # standard deviations


def declared_sensors(
    arm: ArmSpec, geometry: ArmGeometry, moments: int = 0
) -> dict[str, Sensor]:
    """What readings hold; plausible numbers are those of the cables' limits, and of unit vectors.

    Args:
        arm: the description.
        geometry: of it.
        moments: at which the center line is watched in a control step; it is not if
            zero.
    """
    modules = arm.module_count
    said = {
        "cables": _cables(arm, geometry),
        "states": Sensor((modules, 6), "m, 1"),
        "configurations": Sensor(
            (modules, 3), "1", -1.01, 1.01, TURNS_A_STEP * _step_limit(arm)
        ),
    }
    if arm.motor.current_noise is not None:
        said["tensions"] = Sensor((modules, arm.cable_count), "N")
    if moments:
        said["center_line"] = Sensor((moments, modules * CENTER_LINE_POINTS, 3), "m")
    return said


def _cables(arm: ArmSpec, geometry: ArmGeometry) -> Sensor:
    """Encoders, or tension sensors: a quarter of the range and their noise beyond the limits is still plausible."""
    by_length = arm.actuation == "displacement"
    ticks = tick_length(arm.motor) * (1 + arm.motor.noise_ticks)
    noise = NOISE * (ticks if by_length else arm.motor.noise_tension)
    scale = np.abs(geometry.action_scale)[:, None]
    fastest = (TURNS_A_STEP * scale / geometry.action_bends[:, None]) * _step_limit(
        arm
    ) + noise * arm.control_rate
    beyond = 0.25 * scale + noise
    low = geometry.action_low - beyond
    high = geometry.action_high + beyond
    return Sensor(
        geometry.action_neutral.shape, "m" if by_length else "N", low, high, fastest
    )


def _step_limit(arm: ArmSpec) -> float:
    """What commands change by at most, in a second [rad/s]."""
    return float(np.deg2rad(arm.step_limit_deg)) * arm.control_rate
