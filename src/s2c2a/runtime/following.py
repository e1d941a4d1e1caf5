"""Following error: cables whose readings contradict the commands that were sent.

Causes are a wrong gain, a wrong sign, or motors that do not move. A controller that
plans from encoders does not notice them, because it takes their values for true.
"""

from collections import deque

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import Actions, Reading

MAX_LAG = 0.5  # s; beyond the time constant of the motors
MARGIN = 0.25  # part of a module's action range
MIN_DURATION = 0.5  # s; a shorter time outside of the band is no fault


class FollowingMonitor:
    """Compares the readings of the cables with the latest commands.

    A motor that follows with a lag is within the range of these commands. This band,
    widened by `MARGIN`, contracts no faster than the motors' speed limit.
    """

    def __init__(self, arm: ArmSpec):
        """A monitor of an arm at rest."""
        self._geometry = ArmGeometry.of(arm)
        motor = arm.motor
        speed = np.inf if motor.speed_limit is None else motor.speed_limit
        self._max_step = speed * arm.control_period
        self._margin = MARGIN * np.abs(self._geometry.action_scale)[:, None]
        lag = MAX_LAG + motor.time_constant
        self._lag_steps = max(round(lag * arm.control_rate), 2)
        self._max_outside = max(round(MIN_DURATION * arm.control_rate), 3)
        self.reset()

    def reset(self) -> None:
        """Forget all commands, as after the robot was opened at rest."""
        rest = self._geometry.action_neutral
        self._commands = deque([rest], maxlen=self._lag_steps)
        self._low = rest
        self._high = rest
        self._outside = np.zeros(rest.shape, int)

    def sent(self, command: Actions) -> None:
        """Add a command that the robot sent.

        Args:
            command: displacements or tensions [m or N], shape (modules, cables).
        """
        self._commands.append(command.copy())
        commands = np.stack(self._commands)
        self._low = np.minimum(commands.min(axis=0), self._low + self._max_step)
        self._high = np.maximum(commands.max(axis=0), self._high - self._max_step)

    def find_fault(self, reading: Reading) -> str:
        """Describe a cable that does not follow the commands; empty if there is none.

        Args:
            reading: of this control step. Without `cables` [m or N], shape (modules,
                cables), nothing is compared.
        """
        shape = self._outside.shape
        cables = reading.numbers("cables", shape)
        if cables is None:
            return ""
        # comparisons with NaN are false: a missing measurement is no fault
        below = cables < self._low - self._margin
        above = cables > self._high + self._margin
        self._outside = np.where(below | above, self._outside + 1, 0)
        module, cable = np.unravel_index(np.argmax(self._outside), shape)
        if self._outside[module, cable] <= self._max_outside:
            return ""
        return (
            f"the cables do not follow the commands: module {module + 1}, "
            f"cable {cable + 1}; check gain, sign and motors (`s2c2a robot check`)"
        )
