"""Following error: readings of the cables that contradict the commands that were sent.

Causes are encoders that err, a wrong gain, a wrong sign, or motors that do not move. A
controller that plans from encoders does not notice them, because it takes their values
for true. So a reading that the commands do not explain is refused, and so are all that
follow, until one agrees with the commands again.
"""

from collections import deque

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import NOISE_LIMIT, Actions, Reading

MAX_LAG = 0.5  # s; beyond the time constant of the motors
MARGIN = 0.25  # part of a module's action range, of an error that lasts
# The same for an error that appears at once. Motors that are slower than those of the
# arm file by 0.3 s err by up to 0.05. An encoder that errs by just so much moves the tip
# of `twin_arm` by 5 cm (tests/runtime/test_encoder_faults.py).
SUDDEN = 0.08
# The same for the rounding of commands: half of the step of a servo with 8 bits.
ROUNDING = 0.002


class FollowingMonitor:
    """Compares the readings of the cables with the latest commands.

    A motor that follows with a lag is within the range of the commands of the last
    `MAX_LAG`, which contracts no faster than the motors' speed limit. Wrong gains and
    loads move it out of this range gradually. So a reading agrees with the commands if

    - it is within `MARGIN` of their range, and
    - it is within `SUDDEN` of their range, or its deviation from the last command is
      that of the last reading that agreed, within `SUDDEN`.

    While readings are refused, the arm holds, so an honest motor comes to agree.
    """

    def __init__(self, arm: ArmSpec):
        """A monitor of an arm at rest."""
        self._geometry = ArmGeometry.of(arm)
        self._scale = np.abs(self._geometry.action_scale)[:, None]
        motor = arm.motor
        speed = np.inf if motor.speed_limit is None else motor.speed_limit
        self._max_step = speed * arm.control_period
        noise = NOISE_LIMIT * motor.measurement_noise(arm.actuation) / self._scale
        self._margin = MARGIN + noise
        self._sudden = SUDDEN + noise
        lag = MAX_LAG + motor.time_constant
        self._lag_steps = max(round(lag * arm.control_rate), 2)
        self.reset()

    def reset(self) -> None:
        """Forget all commands and readings, as after the robot was opened at rest."""
        rest = self._geometry.action_neutral
        self._commands = deque([rest], maxlen=self._lag_steps)
        self._low = rest
        self._high = rest
        self._last_deviation: Actions | None = None

    def find_excess(self, sent: Actions, command: Actions) -> str:
        """Describe an action that a robot sent in place of a command; empty if it may.

        A robot may limit or reduce a command: what it sends is then between its last
        action, the command, and rest. It may also differ from the command by `SUDDEN`, to
        compensate backlash.

        Args:
            sent: by the robot [m or N], shape (modules, cables).
            command: that it was given, likewise.
        """
        rest = self._geometry.action_neutral
        allowed = np.stack([self._commands[-1], command, rest])
        nearest = np.clip(sent, allowed.min(axis=0), allowed.max(axis=0))
        excess = np.abs(sent - nearest) > ROUNDING * self._scale
        excess &= np.abs(sent - command) > SUDDEN * self._scale
        if not excess.any():
            return ""
        module, cable = np.argwhere(excess)[0]
        return (
            f"it sent {sent[module, cable]:.4g} to module {module + 1}, cable "
            f"{cable + 1} in place of {command[module, cable]:.4g}; a robot may limit a "
            "command, not enlarge it or turn it around: check gain and sign "
            "(`s2c2a robot check`)"
        )

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
        cables = reading.numbers("cables", self._low.shape)
        if cables is None:
            return ""
        deviation = (cables - self._commands[-1]) / self._scale
        nearest = np.clip(cables, self._low, self._high)
        distance = np.abs(cables - nearest) / self._scale
        last = deviation if self._last_deviation is None else self._last_deviation
        is_known = np.abs(deviation - last) <= self._sudden
        # comparisons with NaN are false: a missing measurement is no fault
        contradicts = distance > np.where(is_known, self._margin, self._sudden)
        if contradicts.any():
            module, cable = np.argwhere(contradicts)[0]
            return (
                "the cables do not follow the commands: "
                f"module {module + 1}, cable {cable + 1}; check encoders, gain, sign "
                "and motors (`s2c2a robot check`)"
            )
        self._last_deviation = np.where(np.isnan(deviation), last, deviation)
        return ""
