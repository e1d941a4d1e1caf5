"""Motors and encoders: a first-order lag with a speed limit, and ticks."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import Motor


def motor_path(
    position: Float[np.ndarray, "*cables"], command: Float[np.ndarray, "*cables"], times: np.ndarray, motor: Motor
) -> Float[np.ndarray, "times *cables"]:
    """Positions of motors that chase a held command: exact, so it does not depend on the physics step.

    Args:
        position: where the motors are [m or N].
        command: where they shall go [m or N].
        times: when to say where they are [s], from now.
        motor: lag and speed limit.
    """
    gap = position - command
    size = np.abs(gap)
    later = times.reshape(-1, *[1] * gap.ndim)
    limit = np.inf if motor.speed_limit is None else motor.speed_limit
    lag = motor.time_constant
    slow = np.minimum(size, limit * lag) if lag else np.zeros_like(size)  # gap from which the lag, not the limit, rules
    fast_time = (size - slow) / limit
    left = np.where(later < fast_time, size - np.minimum(limit * later, size) if np.isfinite(limit) else 0.0, 0.0)
    lagging = slow * np.exp(-np.maximum(later - fast_time, 0.0) / lag) if lag else 0.0
    return command + np.sign(gap) * np.where(later < fast_time, left, lagging)


def tick_length(motor: Motor) -> float:
    """Displacement of one encoder tick [m]."""
    return 2 * np.pi * motor.pulley_radius / motor.ticks_per_turn


def encoder_reading(
    position: Float[np.ndarray, "*cables"], motor: Motor, random: np.random.Generator
) -> Float[np.ndarray, "*cables"]:
    """Displacement [m] as the encoders tell it: noise, then whole ticks."""
    tick = tick_length(motor)
    noise = random.normal(scale=motor.noise_ticks, size=position.shape)
    return tick * np.round(position / tick + noise)
