"""Players: drivers that play a motion on the control loop instead of pursuing goals."""

from collections.abc import Iterable, Iterator

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import RobotError
from s2c2a.goals import Goal
from s2c2a.runtime.limits import EQUAL
from s2c2a.runtime.loop import Loop
from s2c2a.runtime.record import StepRecord
from s2c2a.runtime.stages import StepRequest
from s2c2a.spaces import Actions, Reading, Stage


class Player:
    """Driver that plays commands, one a control step.

    A motion that depends on readings is a generator that looks at `reading` and
    `command` between its commands. In a step in which the arm is held, no command is
    taken.

    Attributes:
        motion: commands that it plays, from its next start on.
        reading: of this step.
        command: that the loop sent in the last step, shape (modules, cables) [m or N].
        is_done: whether there is no command left; the last one is then held.
    """

    name = "player"

    def __init__(
        self, arm: ArmSpec, sensors: tuple[str, ...], motion: Iterable[Actions] = ()
    ):
        """A player at the start of a motion.

        Args:
            arm: that it moves.
            sensors: names of those that must be sound for the arm to move.
            motion: commands [m or N], each of shape (modules, cables).
        """
        self.arm = arm
        self.sensors = sensors
        self.is_done = False
        self._geometry = ArmGeometry.of(arm)
        self.motion = motion

    def start(self, reading: Reading) -> None:
        """Start at the first command."""
        self._commands = iter(self.motion)

    def estimate(self, reading: Reading, last_command: Actions) -> Reading:
        """The reading itself."""
        self.reading = reading
        self.command = last_command
        return reading

    def plan(self, estimate: Reading, goal: Goal) -> Goal:
        """The goal itself, which is ignored."""
        return goal

    def act(self, plan: Goal, estimate: Reading) -> Actions:
        """Next command."""
        command = next(self._commands, None)
        self.is_done = command is None
        return self.command if command is None else command

    def sent(self, action: Actions) -> None:
        """Do nothing: motions look at `command`."""

    def diagnostics(self) -> dict[str, np.ndarray]:
        """No diagnostics."""
        return {}

    def approach(self, target: Actions) -> Iterator[Actions]:
        """Yield a target within its range until the loop has sent it, within limits."""
        tolerance = EQUAL * np.abs(self._geometry.action_scale)[:, None]
        while True:
            yield target
            if (np.abs(self.command - target) <= tolerance).all():
                return

    def hold(self, target: Actions, seconds: float) -> Iterator[Actions]:
        """Yield a target for a time [s]."""
        for _ in range(round(seconds * self.arm.control_rate)):
            yield target


def play(loop: Loop, player: Player) -> Iterator[StepRecord]:
    """Yield the steps of an open loop until its player is done.

    Raises:
        RobotError: readings had a fault for too long, or the program stood still.
    """
    while not player.is_done:
        step = loop.tick(StepRequest())
        if loop.standstill:
            raise RobotError(
                f"{loop.standstill} in the middle of a motion, which ends here; see "
                "that nobody touches the arm, then start again"
            )
        if step.stage not in (Stage.START, Stage.RUN, Stage.HOLD):
            raise RobotError(f"the arm stopped: {loop.fault}")
        yield step
