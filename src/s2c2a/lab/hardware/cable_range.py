"""Range of the cables: limits of commands, and what is plausible beyond them."""

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec, servos_of
from s2c2a.errors import RobotError
from s2c2a.spaces import Actions

MARGIN = 0.25  # of the range, beyond the limits; more shows a wrong calibration


def displacement_limits(arm: ArmSpec) -> tuple[Actions, Actions]:
    """Return the smallest and largest displacements [m], shape (modules, cables)."""
    geometry = ArmGeometry.of(arm)
    limit = servos_of(arm).limits.displacement
    if limit is None:
        return geometry.action_low, geometry.action_high
    return (
        np.maximum(geometry.action_low, -limit),
        np.minimum(geometry.action_high, limit),
    )


def check_plausible(displacements: Actions, arm: ArmSpec) -> None:
    """Check that the cables of an arm that begins to move can be where they seem to be.

    Args:
        displacements: measured [m], shape (modules, cables).
        arm: with its range.

    Raises:
        RobotError: a cable is further out of its range than `MARGIN`.
    """
    low, high = displacement_limits(arm)
    room = MARGIN * (high - low)
    outside = (displacements < low - room) | (displacements > high + room)
    if outside.any():
        ids = np.array(servos_of(arm).ids)[outside].tolist()
        places = 1000 * displacements[outside]
        raise RobotError(
            f"the cables of servos {ids} stand at {places.round(1).tolist()} mm, "
            "out of their range; the calibration no longer fits. Home the arm "
            "again (`s2c2a motors home`)"
        )
