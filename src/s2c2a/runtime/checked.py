"""Robots and controllers, perhaps a user's own: their exceptions and answers are checked.

They get and leave copies alone: code in C writes through pointers whatever NumPy forbids.
"""

import warnings
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.episodes.episode import SENSOR
from s2c2a.errors import ControllerError, RobotError, S2C2AError
from s2c2a.goals import Goal, checked_parts, warn_of_ignored
from s2c2a.plugins.immutable import immutable
from s2c2a.robots import Robot
from s2c2a.runtime.border import attribute, named_errors
from s2c2a.runtime.clock import Clock
from s2c2a.runtime.driver import Driver, StatedDriver
from s2c2a.runtime.record import OWN_COLUMNS
from s2c2a.spaces import FOLLOWS_FROM, Actions, Reading, Sensor

REQUIRED = ("arm", "sensors", "start", "estimate", "plan", "act", "sent", "diagnostics")
# control periods that an answer may take: one late answer, until the middle of the
# period after the next, is no fault
BLOCKED_PERIODS = 2.5


class _Checked:
    """The methods of an object; a failure becomes an error that names it."""

    def __init__(
        self, part: Any, error_type: type[S2C2AError], step: Callable[[], int]
    ):
        self._part = part
        self._kind = type(part).__name__
        self._error_type = error_type
        self._step = step

    def error(self, method: str, text: str) -> S2C2AError:
        """Return an error that names a method of the object."""
        return self._error_type(f"{self._failure(method)}: {text}")

    def _call(
        self, method: str, *arguments: Any, read: Callable[[Any], Any] | None = None
    ) -> Any:
        """Call a method; what reads its answer may fail by what it finds there."""
        with self._errors(method):
            answer = getattr(self._part, method)(*arguments)
            return answer if read is None else read(answer)

    def _errors(self, method: str) -> AbstractContextManager[None]:
        return named_errors(self._error_type, self._failure(method))

    def _failure(self, method: str) -> str:
        return f"{self._kind}.{method} failed in step {self._step()}"


class CheckedDriver(_Checked):
    """The methods of a `Driver`; a failure becomes a `ControllerError` that names it.

    Attributes:
        driver: the controller.
        arm: that it shall control.
    """

    def __init__(self, driver: Driver[Any, Any], arm: ArmSpec, step: Callable[[], int]):
        """A controller that has not started.

        Args:
            driver: the controller.
            arm: that it shall control.
            step: returns the number of the control step, for messages.

        Raises:
            S2C2AError: it lacks a method or an attribute.
        """
        part = driver.driver if isinstance(driver, StatedDriver) else driver
        absent = object()
        missing = [
            f"`{name}`"
            for name in REQUIRED
            if attribute(part, name, ControllerError, absent) is absent
        ]
        if missing:
            raise S2C2AError(
                f"the controller {type(part).__name__} has no {', '.join(missing)}; "
                "see `runtime.Driver` (docs/guides/extending.md)"
            )
        super().__init__(part, ControllerError, step)
        self.driver = driver
        self.arm = arm
        stated = attribute(driver, "ignores", ControllerError, ())
        self._ignores = checked_parts(stated, part)
        self._shape = (arm.module_count, arm.cable_count)

    @property
    def name(self) -> str:
        """Name in records; that of its class if it has none."""
        return str(attribute(self.driver, "name", ControllerError, self._kind))

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that it requires."""
        with self._errors("sensors"):
            return tuple(self.driver.sensors)

    def required_sensors(self, sensors: Mapping[str, Sensor]) -> list[str]:
        """Return the names of the robot's sensors that the controller requires.

        Raises:
            S2C2AError: it is for another arm, or requires a sensor that the robot
                lacks.
        """
        with self._errors("arm"):
            theirs = self.driver.arm.module_count, self.driver.arm.cable_count
        if theirs != self._shape:
            raise S2C2AError(
                f"the controller is for an arm of (modules, cables) {theirs}; "
                f"'{self.arm.name}' has {self._shape}; choose a controller for this arm"
            )
        required = [
            name if name in sensors else FOLLOWS_FROM.get(name, name)
            for name in self.sensors
        ]
        missing = [name for name in required if name not in sensors]
        if missing:
            raise S2C2AError(
                f"the controller needs {', '.join(missing)}; "
                f"the robot provides {', '.join(sensors) or 'no sensor'}; "
                "change `sensing` in the arm file, or choose another robot"
            )
        return required

    def set_real_time(self, is_real: bool) -> None:
        """Tell the controller whether steps must not wait, if it has this method."""
        if attribute(self._part, "set_real_time", ControllerError, None):
            self._call("set_real_time", is_real)

    def start(self, reading: Reading) -> None:
        """Start the controller."""
        self._call("start", replace(reading))

    def estimate(self, reading: Reading, last_command: Actions) -> Any:
        """Return its estimate."""
        return self._call("estimate", replace(reading), immutable(last_command))

    def plan(self, estimate: Any, goal: Goal) -> Any:
        """Return its plan; warn once of what it ignores of goals."""
        if self._ignores:  # the parts of a goal take time to find
            ignored = self._ignores & goal.parts
            warn_of_ignored(self.name, ignored)
            self._ignores -= ignored
        return self._call("plan", estimate, goal.frozen())

    def act(self, plan: Any, estimate: Any) -> Actions:
        """Return a copy of the desired command; warn where it is NaN or infinite.

        Raises:
            ControllerError: it has another shape, or holds no numbers.
        """
        desired = self._call("act", plan, estimate, read=partial(np.array, dtype=float))
        if desired.shape != self._shape:
            raise ControllerError(
                f"`act` of the controller {self._kind} returned shape "
                f"{desired.shape} in step {self._step()}; it must return the command "
                f"of every cable [m or N], shape (modules, cables) {self._shape}"
            )
        if not np.isfinite(desired).all():
            text = "values that are NaN or infinite; their cables hold the last command"
            warnings.warn(f"`act` of {self._kind} returns {text}", stacklevel=1)
        return desired

    def sent(self, action: Actions) -> None:
        """Tell it the command that replaced its action."""
        self._call("sent", immutable(action))

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Return copies of the telemetry.

        Raises:
            ControllerError: a column would replace what the loop records.
        """
        columns = self._call("diagnostics", read=_columns)
        for name in columns:
            is_text = isinstance(name, str)
            if not is_text or name in OWN_COLUMNS or name.startswith(SENSOR):
                raise self.error(
                    "diagnostics",
                    f"{name!r} is no name "
                    "for a controller's own telemetry; choose a text other than "
                    f"{', '.join(sorted(OWN_COLUMNS))}, without '{SENSOR}' before it",
                )
        return columns


def _columns(answer: Any) -> dict[str, np.ndarray]:
    return {name: np.array(value) for name, value in dict(answer).items()}


class CheckedRobot(_Checked):
    """The methods of a `Robot`; a failure becomes a `RobotError` that names it.

    Attributes:
        robot: the robot.
        own_time: whether time passes in `advance` alone.
    """

    def __init__(
        self, robot: Robot, clock: Clock, period: float, step: Callable[[], int]
    ):
        """A robot that is not open yet.

        Args:
            robot: the robot.
            clock: measures how long calls take.
            period: of the sensors [s]; motions may command more often.
            step: returns the number of the control step, for messages.
        """
        super().__init__(robot, RobotError, step)
        self.robot = robot
        self.own_time = attribute(robot, "own_time", RobotError)
        self._clock = clock
        self._longest = BLOCKED_PERIODS * period
        self._fault = ""

    def take_fault(self) -> str:
        """Describe a call that blocked since the last question; empty if none did."""
        fault = self._fault
        self._fault = ""
        return fault

    @property
    def sensors(self) -> dict[str, Sensor]:
        """Declared sensors by name."""
        with self._errors("sensors"):
            declared = dict(self.robot.sensors)
        for name, sensor in declared.items():
            if not isinstance(sensor, Sensor):
                raise self.error("sensors", f"'{name}' is {sensor!r}, not a Sensor")
        return {name: replace(sensor) for name, sensor in declared.items()}

    def open(self) -> Reading:
        """Open the robot and return the first reading."""
        return self._reading("open", self._call("open"))

    def read(self) -> Reading:
        """Return a reading with a time; values of sensors are checked later."""
        return self._reading("read", self._timed("read"))

    def send(self, command: Actions) -> Any:
        """Send a copy of a command, which the robot may change; return its answer."""
        return self._timed("send", command.copy())

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
        self._call("advance", seconds)

    def halt(self) -> None:
        """Stop the robot where it is."""
        self._call("halt")

    def close(self) -> None:
        """Close the robot."""
        self._call("close")

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
        return replace(answer)

    def _timed(self, method: str, *arguments: Any) -> Any:
        """Call a method; one that blocks is a fault of the next step."""
        began = self._clock.now()
        answer = self._call(method, *arguments)
        elapsed = self._clock.now() - began
        if elapsed > self._longest:
            self._fault = f"{self._kind}.{method} blocked for {elapsed:.1f} s"
        return answer
