"""Steering of the target by keys or sticks, at a limited speed."""

import time

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.live.request import Point, point

SPEED = 0.25
"""Largest speed of the target, in arm lengths a second: 15 cm/s with 0.6 m.

An arm of 4 deg a step at 10 Hz bends about as fast."""
LARGEST_STEP = 0.1  # s; a program that stood still does not make up for it
EXPIRY = 0.3  # s; a browser repeats its keys every 0.05 s

Vector = Float[np.ndarray, "3"]


def largest_speed(arm: ArmSpec) -> float:
    """Largest speed of the target of an arm [m/s]."""
    return SPEED * arm.length


def moved_target(target: Point, velocity: Point, seconds: float, arm: ArmSpec) -> Point:
    """The target after a time, slower than `largest_speed` and within the arm's length.

    Args:
        target: position [m], base frame.
        velocity: desired velocity [m/s], base frame; zeros if it is not finite.
        seconds: since the last call.
        arm: that follows the target.
    """
    wanted = np.nan_to_num(np.array(velocity, float), nan=0.0, posinf=0.0, neginf=0.0)
    speed = max(float(np.linalg.norm(wanted)), 1e-9)
    allowed = wanted * min(1.0, largest_speed(arm) / speed)
    moved = np.array(target) + min(max(seconds, 0.0), LARGEST_STEP) * allowed
    distance = max(float(np.linalg.norm(moved)), 1e-9)
    # a target out of reach, where a drag has put it, may come back and go no further
    farthest = max(arm.length, float(np.linalg.norm(target)))
    return point(moved * min(1.0, farthest / distance))


class Steering:
    """The latest direction that the driver's browser steers, which soon expires."""

    def __init__(self) -> None:
        """Start without motion."""
        self._direction: Point = (0.0, 0.0, 0.0)
        self._until = 0.0

    def set(self, direction: Point) -> None:
        """Steer to the right, forward and upward, each in parts of the largest speed."""
        self._direction = direction
        self._until = time.monotonic() + EXPIRY

    def direction(self) -> Point | None:
        """The direction, or None at rest."""
        if time.monotonic() > self._until or not any(self._direction):
            return None
        return self._direction


def across_view(
    direction: Point,
    position: Vector,
    look_at: Vector,
    up: Vector,
) -> Vector:
    """Turn a direction of a screen to the base frame; forward is level.

    Args:
        direction: to the right, forward and upward.
        position: of the camera [m], base frame.
        look_at: where it looks [m], base frame.
        up: unit vector upward, base frame.
    """
    right = np.cross(np.subtract(look_at, position), up)
    length = float(np.linalg.norm(right))
    if length < 1e-6:  # straight from above: any level direction does
        right = np.cross(up, np.roll(up, 1))
        length = float(np.linalg.norm(right))
    right = right / length
    axes = np.array([right, np.cross(up, right), up])
    return np.array(direction) @ axes
