"""A robot, perhaps a user's own: its exceptions and answers are checked."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import numpy as np

from s2c2a.errors import RobotError
from s2c2a.robots import Robot
from s2c2a.runtime.border import named_errors
from s2c2a.runtime.clock import Clock
from s2c2a.spaces import Actions, Reading, Sensor

# control periods that an answer may take: one late answer, until the middle of the
# period after the next, is no fault
BLOCKED_PERIODS = 2.5


class CheckedRobot:
    """The methods of a `Robot`; a failure becomes a `RobotError` that names it.

    Attributes:
        robot: the robot.
    """

    def __init__(
        self, robot: Robot, clock: Clock, period: float, step: Callable[[], int]
    ):
        """A robot that is not open yet.

        Args:
            robot: the robot.
            clock: measures how long calls take.
            period: of the control steps [s].
            step: returns the number of the control step, for messages.
        """
        self.robot = robot
        self._clock = clock
        self._longest = BLOCKED_PERIODS * period
        self._step = step
        self.reset()

    def reset(self) -> None:
        """Forget calls that blocked."""
        self._fault = ""

    def take_fault(self) -> str:
        """Describe a call that blocked since the last question; empty if none did."""
        fault = self._fault
        self._fault = ""
        return fault

    @property
    def own_time(self) -> bool:
        """Whether time passes in `advance` alone."""
        return self.robot.own_time

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Declared sensors by name."""
        with self._errors("sensors"):
            declared = dict(self.robot.sensors)
        for name, sensor in declared.items():
            if not isinstance(sensor, Sensor):
                raise self.error("sensors", f"'{name}' is {sensor!r}, not a Sensor")
        return declared

    def open(self) -> Reading:
        """Open the robot and return the first reading."""
        with self._errors("open"):
            answer = self.robot.open()
        return self._reading("open", answer)

    def read(self) -> Reading:
        """Return a reading with a time; values of sensors are checked later."""
        with self._timed("read"):
            answer = self.robot.read()
        return self._reading("read", answer)

    def send(self, command: Actions) -> Any:
        """Send a copy of a command, which the robot may change; return its answer."""
        with self._timed("send"):
            return self.robot.send(command.copy())

    def sent_action(self, answer: Any, shape: tuple[int, ...]) -> Actions:
        """Return the action that the robot answered that it sent.

        Raises:
            RobotError: the answer is no action.
        """
        try:
            sent = np.array(answer, dtype=float)
        except (TypeError, ValueError) as error:
            raise self.error("send", f"it returned {answer!r}") from error
        if sent.shape != shape or not np.isfinite(sent).all():
            text = f"it returned {answer!r}, not the action that it sent"
            raise self.error("send", text)
        return sent

    def advance(self, seconds: float) -> None:
        """Let time pass [s]."""
        with self._errors("advance"):
            self.robot.advance(seconds)

    def halt(self) -> None:
        """Stop the robot where it is."""
        with self._errors("halt"):
            self.robot.halt()

    def close(self) -> None:
        """Close the robot."""
        with self._errors("close"):
            self.robot.close()

    def error(self, method: str, text: str) -> RobotError:
        """Return an error that names a method of the robot."""
        return RobotError(f"{self._failure(method)}: {text}")

    def _reading(self, method: str, answer: Any) -> Reading:
        if not isinstance(answer, Reading):
            raise self.error(method, f"it returned {answer!r}, not a Reading")
        moment = np.asarray(answer.time)
        if moment.dtype.kind not in "fiu" or moment.shape:
            text = (
                f"the time of its reading is {answer.time!r}, not a number of seconds"
            )
            raise self.error(method, text)
        if not isinstance(answer.fault, str):
            text = f"the fault of its reading is {answer.fault!r}, not a text"
            raise self.error(method, text)
        return answer

    @contextmanager
    def _timed(self, method: str) -> Iterator[None]:
        """Name errors of a call; one that blocks is a fault of the next step."""
        began = self._clock.now()
        with self._errors(method):
            yield
        elapsed = self._clock.now() - began
        if elapsed > self._longest:
            name = type(self.robot).__name__
            self._fault = f"{name}.{method} blocked for {elapsed:.1f} s"

    def _errors(self, method: str) -> AbstractContextManager[None]:
        return named_errors(RobotError, self._failure(method))

    def _failure(self, method: str) -> str:
        return f"{type(self.robot).__name__}.{method} failed in step {self._step()}"
