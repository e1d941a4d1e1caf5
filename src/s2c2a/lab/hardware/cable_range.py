"""Range of the cables: what is plausible beyond the limits of commands."""

from s2c2a.arm import ArmSpec
from s2c2a.errors import RobotError
from s2c2a.lab.hardware.winch import servo_ids
from s2c2a.runtime.limits import command_range
from s2c2a.spaces import Actions

MARGIN = 0.25  # of the range, beyond the limits; more shows a wrong calibration


def check_plausible(displacements: Actions, arm: ArmSpec) -> None:
    """Check that the cables of an arm that begins to move can be where they seem to be.

    Args:
        displacements: measured [m], shape (modules, cables).
        arm: with its range.

    Raises:
        RobotError: a cable is further out of its range than `MARGIN`.
    """
    low, high = command_range(arm)
    room = MARGIN * (high - low)
    outside = (displacements < low - room) | (displacements > high + room)
    if outside.any():
        ids = servo_ids(arm)[outside].tolist()
        places = 1000 * displacements[outside]
        raise RobotError(
            f"the cables of servos {ids} stand at {places.round(1).tolist()} mm, "
            "out of their range; the calibration no longer fits. Home the arm "
            "again (`s2c2a motors home`)"
        )
