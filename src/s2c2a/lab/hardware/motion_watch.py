"""Watch over motions below `Robot.send`: homing, and the way of cables to rest.

The control loop (`runtime.Loop`) does not play these motions. It limits bends of an arm
that begins at rest and returns there. Before the arm is homed there is no rest and no
bend, and a cable that opens may be anywhere, also slack or beyond its range. A cable that
becomes taut stops against its commands on purpose, which is a fault in the loop. Servos
limit speed and current by themselves, and such a motion ends where it is.
"""

import time

from s2c2a.errors import RobotError, S2C2AError
from s2c2a.runtime.clock import STANDSTILL, time_with_sleep
from s2c2a.runtime.emergency import EMERGENCY_STOP


class MotionWatch:
    """Ends one motion of servos that must not go on."""

    def __init__(self, longest: float, overdue: S2C2AError):
        """The motion begins now.

        Args:
            longest: time that it may take [s].
            overdue: the error if it takes longer.
        """
        self._last = time_with_sleep()
        self._end = time.perf_counter() + longest
        self._overdue = overdue

    def check(self) -> None:
        """Check before every goal that is sent.

        Raises:
            EmergencyStopError: nothing must move.
            RobotError: the program stood still.
            S2C2AError: the motion takes too long.
        """
        EMERGENCY_STOP.check()
        # check the time since the last goal: who started the motion may have left
        now = time_with_sleep()
        pause = now - self._last
        if pause > STANDSTILL:
            raise RobotError(
                f"the program stood still for {pause:.1f} s in the middle of a motion, "
                "which ends here; see that nobody touches the arm, then start again"
            )
        self._last = now
        if time.perf_counter() > self._end:
            raise self._overdue
