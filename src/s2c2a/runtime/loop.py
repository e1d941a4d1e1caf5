"""Control loop: read, check, decide, limit, and send, at a fixed rate.

Every arm, simulated or real, is driven by `Loop.tick`, once a control period. Whatever
a sensor, a plan, or a network outputs, the command that reaches the robot is limited in
value, rate, and acceleration (`CommandLimits`). An arm whose readings fail the check is
held, then moved to rest (`stages`). However the loop ends, it ends at rest.

Robots and controllers may be anybody's: what they get and return is copied, so that they
cannot change what the loop remembers, and their exceptions become errors that name them.
"""

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from typing import Any, Protocol, Self

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.emergency import EMERGENCY_STOP, EmergencyStop, EmergencyStopError
from s2c2a.episodes.episode import SENSOR
from s2c2a.errors import ControllerError, RobotError, S2C2AError
from s2c2a.goals import Goal
from s2c2a.robots import Robot
from s2c2a.runtime.border import named_errors
from s2c2a.runtime.clock import Clock, StepClock, WallClock
from s2c2a.runtime.feedback import Feedback
from s2c2a.runtime.following import FollowingMonitor
from s2c2a.runtime.limits import CommandLimiter, CommandLimits
from s2c2a.runtime.oscillation import OscillationMonitor
from s2c2a.runtime.readings import ReadingCheck
from s2c2a.runtime.record import OWN_COLUMNS, StepRecord
from s2c2a.runtime.stages import (
    Patience,
    Phase,
    StepRequest,
    next_phase,
    with_fault,
    with_hold,
    with_release,
)
from s2c2a.spaces import FOLLOWS_FROM, Actions, Reading, Sensor, Stage

LATE = 0.1  # of a control period; a step with a longer delay counts as late
INTERRUPTS = ("SIGINT", "SIGTERM", "SIGHUP")  # not every system has all
BLOCKED_PERIODS = 2.5  # control periods; a robot that takes longer to answer blocks


class Driver(Protocol):
    """Controller that chooses the action of every control step, such as a strategy.

    Attributes:
        feedback: share of the feedback that it may use, from 0 to 1. The loop sets it
            before every step and lowers it when the arm vibrates. A controller that
            ignores it is held if the vibration goes on.
    """

    feedback: float

    @property
    def name(self) -> str:
        """Name in records and tables."""

    @property
    def arm(self) -> ArmSpec:
        """Arm that it controls."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that it requires."""

    def start(self, reading: Reading) -> None:
        """Begin to control an arm at rest."""

    def estimate(self, reading: Reading, last_command: Actions) -> Any:
        """Estimate the state of the arm.

        Args:
            reading: latest.
            last_command: that was sent in the last step [m or N], shape (modules,
                cables).
        """

    def plan(self, estimate: Any, goal: Goal) -> Any:
        """Plan toward a goal."""

    def act(self, plan: Any, estimate: Any) -> Actions:
        """Return the command [m or N], shape (modules, cables)."""

    def sent(self, action: Actions) -> None:
        """Receive the command that replaced the last action.

        The loop calls this after every step whose action exceeded a limit.
        """

    def diagnostics(self) -> Mapping[str, np.ndarray]:
        """Return telemetry of the last step, by column of an episode (`planned`)."""


METHODS = ("start", "estimate", "plan", "act", "sent", "diagnostics")
ATTRIBUTES = ("arm", "sensors")


def _check_methods(driver: Driver) -> None:
    """Check that a controller, perhaps a user's own, has what the loop calls.

    Raises:
        S2C2AError: it lacks a method or an attribute.
    """
    missing = [
        *(f"`{name}`" for name in ATTRIBUTES if not hasattr(driver, name)),
        *(f"`{name}()`" for name in METHODS if not hasattr(driver, name)),
    ]
    if missing:
        raise S2C2AError(
            f"the controller {type(driver).__name__} has no {', '.join(missing)}; see "
            "`runtime.Driver` (docs/guides/extending.md)"
        )


class Loop:
    """Control loop of one robot: one `tick` a control period.

    A context manager that opens the robot, and in the end moves it to rest and closes
    it.

    Attributes:
        arm: arm of the robot.
        driver: controller; may be replaced (`use`) while the arm is at rest.
        phase: stage of the arm and its counters.
        fault: reason of a stop, or fault of the latest reading; empty without one.
        standstill: how long the program stood still, while the arm is held for that
            reason; empty otherwise.
        late_steps: number of steps that began late.
        blocked_steps: number of calls in which the robot took too long to answer.
        feedback: share of the feedback in use, and how often the arm vibrated.
    """

    def __init__(
        self,
        robot: Robot,
        driver: Driver,
        clock: Clock | None = None,
        limits: CommandLimits | None = None,
        patience: Patience | None = None,
        on_step: Callable[[StepRecord], None] = lambda step: None,
        faults: Callable[[Reading], Reading] = lambda reading: reading,
        sensing: Callable[[Reading], Reading] = lambda reading: reading,
        monitors_vibration: bool = True,
        emergency_stop: EmergencyStop = EMERGENCY_STOP,
    ):
        """A loop whose robot is not open yet.

        Args:
            robot: robot to control.
            driver: controller.
            clock: source of time; by default the wall clock for robots that move in
                real time, else a `StepClock`.
            limits: limits of commands; the arm's own by default.
            patience: time limits for unsound readings and for an absent operator.
            on_step: called with the record of every step; it must be quick.
            faults: fault injection for tests: changes every reading before the check.
            sensing: what the controller sees of a reading that passed the check, such
                as the inaccurate sensors of the live page.
            monitors_vibration: whether vibration reduces the feedback; not for a driver
                that plays back motions, which may vibrate on purpose.
            emergency_stop: ends the motion within one control step; the robot then
                stays where it is, or is released (`Robot.halt`).

        Raises:
            S2C2AError: the controller is for another arm, or requires a sensor that
                the robot lacks.
        """
        self.arm = robot.arm
        self._robot = robot
        self._patience = patience or Patience.of(self.arm.control_rate)
        self._on_step = on_step
        self._faults = faults
        self._no_goal = Goal.of(self.arm.module_count)
        self._limits = limits or CommandLimits.of(self.arm)
        self._clock = clock or (StepClock() if robot.own_time else WallClock())
        self._due = 0.0
        self._opened_at = 0.0
        self._commanded_at = np.inf
        self._step_count = 0
        self._tick_time = 0.0
        self._blocked: str = ""
        self.late_steps = 0
        self.phase = Phase()
        self._following = FollowingMonitor(self.arm)
        self._sensing = sensing
        self._monitor = OscillationMonitor(self.arm)
        self._monitors_vibration = monitors_vibration
        self._emergency_stop = emergency_stop
        self._halted = False
        self.use(driver)
        self._reset()

    def use(self, driver: Driver) -> None:
        """Change the controller; it starts when the arm next runs from rest.

        Raises:
            S2C2AError: see `Loop`.
        """
        _check_methods(driver)
        required = self.required_sensors(driver)
        self.driver = driver
        self._check = ReadingCheck(
            self._declared_sensors(),
            required,
            self.arm.control_period,
            self._following,
        )

    @property
    def driver_name(self) -> str:
        """Name of the controller in records; that of its class if it has none."""
        with self._controller_errors("name"):
            return str(getattr(self.driver, "name", type(self.driver).__name__))

    def required_sensors(self, driver: Driver) -> list[str]:
        """Return the names of the robot's sensors that a controller requires.

        Raises:
            S2C2AError: see `Loop`.
        """
        with named_errors(ControllerError, f"{type(driver).__name__}.arm failed"):
            theirs = driver.arm.module_count, driver.arm.cable_count
        ours = self.arm.module_count, self.arm.cable_count
        if theirs != ours:
            raise S2C2AError(
                f"the controller is for an arm of (modules, cables) {theirs}; "
                f"'{self.arm.name}' has {ours}; choose a controller for this arm"
            )
        sensors = self._declared_sensors()
        with named_errors(ControllerError, f"{type(driver).__name__}.sensors failed"):
            names = tuple(driver.sensors)
        required = [
            name if name in sensors else FOLLOWS_FROM.get(name, name) for name in names
        ]
        missing = [name for name in required if name not in sensors]
        if missing:
            raise S2C2AError(
                f"the controller needs {', '.join(missing)}; "
                f"the robot provides {', '.join(sensors) or 'no sensor'}; "
                "change `sensing` in the arm file, or choose another robot"
            )
        return required

    def open(self) -> None:
        """Open the robot at rest; a second call starts again from there.

        Raises:
            EmergencyStopError: the emergency stop has not been reset.
            RobotError: the robot failed.
        """
        self._emergency_stop.check()
        with self._robot_errors("open"):
            answer = self._robot.open()
        first_reading = self._checked_reading("open", answer)
        self._reset()
        self._due = self._clock.now()
        self._opened_at = self._due - first_reading.time

    def tick(self, request: StepRequest) -> StepRecord:
        """Wait for the next control step and do it.

        Raises:
            S2C2AError: any error of the robot or the controller; the arm then stays
                stopped until it is opened again.
        """
        if self._stopped:
            raise S2C2AError(self.fault)
        moment, delay = self._wait()
        with self._stop_on_error():
            self._emergency_stop.check()
            reading = self._faults(self._read())
            self._notice_standstill()
            fault = self._find_fault(reading, moment)
            if not fault:
                reading = self._sensing(reading)
            previous_stage = self._update_stage(request, fault)
            if self._is_passive(fault):
                sent = self._passive_step()
                diagnostics = {}
            else:
                if previous_stage in (Stage.IDLE, Stage.START):
                    # an arm at rest may wait for a controller that compiles
                    self._commanded_at = np.inf
                    self._ask("start", reading)
                sent = self._control_step(reading, self._goal(request))
                diagnostics = self._diagnostics()
        record = StepRecord(
            self._step_count, moment, self.phase.stage, reading, request.goal, sent,
            diagnostics, self._tick_time, delay, self.fault, self.vibration,
        )  # fmt: skip
        self._step_count += 1
        self._on_step(record)
        return record

    def stop(self, error: BaseException) -> None:
        """Stop the arm where it is because of an error, until it is opened again."""
        self.phase = with_fault(self.phase)
        self.fault = str(error) or type(error).__name__
        self._stopped = True
        if isinstance(error, EmergencyStopError):
            self._halted = True
            with self._robot_errors("halt"):
                self._robot.halt()

    def resume(self) -> None:
        """Let an arm go on that is held because the program stood still.

        Whoever calls it makes sure that the arm may move.
        """
        self.standstill = ""
        self._commanded_at = self._clock.with_sleep()

    def _checked_command(self, answer: Any) -> Actions:
        """A copy of the desired command, if it has a number for every cable.

        Raises:
            ControllerError: it has another shape, or holds no numbers.
        """
        with self._controller_errors("act"):
            desired = np.array(answer, dtype=float)
        expected = (self.arm.module_count, self.arm.cable_count)
        if desired.shape != expected:
            raise ControllerError(
                f"`act` of the controller {type(self.driver).__name__} returned shape "
                f"{desired.shape} in step {self._step_count}; it must return the command "
                f"of every cable [m or N], shape (modules, cables) {expected}"
            )
        return desired

    def release(self) -> None:
        """Begin to move the arm to rest within its limits; no reading is needed."""
        self.phase = with_release(self.phase)

    def to_rest(self) -> Iterator[StepRecord]:
        """Release the arm and yield the steps until it is at rest."""
        self.release()
        while self.phase.stage is Stage.RELEASE:
            yield self.tick(StepRequest(enabled=False))

    def close(self) -> None:
        """Move a real arm to rest, whatever it reads, and close the robot.

        A command that fails is repeated. The motion ends at an emergency stop, and where
        the robot fails in every step for as long as readings may be unsound (1 s, see
        `Patience`).

        Keyboard interrupts are ignored meanwhile: a second one does not leave the arm
        bent.
        """
        self._due = self._clock.now()
        with _ignored_interrupts():
            try:
                self._go_to_rest()
            finally:
                self._close_robot()

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self._close_robot()
            raise
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _close_robot(self) -> None:
        with self._robot_errors("close"):
            self._robot.close()

    def _go_to_rest(self) -> None:
        """Move to rest past failures, until too many follow each other."""
        failures = 0
        while self._is_led_to_rest() and not self._limiter.at_rest:
            try:
                self._step_to_rest()
                failures = 0
            # of the robot, which may also call `exit`; the next step may succeed
            except (Exception, SystemExit):
                failures += 1
            if failures >= self._patience.unsound:
                return

    def _step_to_rest(self) -> None:
        """Wait, and send the next command on the way to rest.

        Raises:
            EmergencyStopError: the arm must not move; it is halted.
        """
        self._wait()
        try:
            self._emergency_stop.check()
        except EmergencyStopError as error:
            self.stop(error)
            raise
        self._send(self._limiter.limit(self._limiter.towards_rest()))

    def _is_led_to_rest(self) -> bool:
        """Whether the robot moves to rest at the end; simulations only after errors."""
        if self._halted:
            return False
        return self._stopped or not self._robot.own_time

    def _reset(self) -> None:
        self._check.reset()
        self._monitor.reset()
        self.feedback = Feedback()
        self.vibration = ""
        self._limiter = CommandLimiter(self._limits)
        self._blocked = ""
        self.blocked_steps = 0
        self.phase = Phase()
        self.fault = ""
        self.standstill = ""
        self._stopped = False
        self._halted = False

    def _wait(self) -> tuple[float, float]:
        """Wait until the next step is due; return the time and the delay [s].

        Steps that were missed are skipped.
        """
        self._clock.wait_until(self._due)
        now = self._clock.now()
        period = self.arm.control_period
        delay = max(now - self._due, 0.0)
        self.late_steps += delay > LATE * period
        self._due += period * (1 + int(delay / period))
        return now, delay

    def _notice_standstill(self) -> None:
        """Hold a real arm in motion that had no command for too long."""
        if self._robot.own_time or self.phase.stage not in (Stage.RUN, Stage.HOLD):
            return
        pause = self._clock.with_sleep() - self._commanded_at
        if pause <= self.arm.control_period + self._patience.standstill:
            return
        self.standstill = f"the program stood still for {pause:.1f} s"
        self.phase = with_hold(self.phase)
        self.fault = self.standstill

    @contextmanager
    def _stop_on_error(self) -> Iterator[None]:
        try:
            yield
        except BaseException as error:
            self.stop(error)
            raise

    def _find_fault(self, reading: Reading, moment: float) -> str:
        """Describe a blocked call or an unsound reading.

        Args:
            reading: of this step.
            moment: of this step, on the loop's clock [s].
        """
        fault = self._blocked or self._check_reading(reading, moment)
        self._blocked = ""
        return fault

    def _check_reading(self, reading: Reading, moment: float) -> str:
        """Describe the fault of a reading, if any; in simulation, none is too old."""
        now = reading.time if self._robot.own_time else moment - self._opened_at
        return self._check.find_fault(reading, now, self._limiter.last_change)

    def _update_stage(self, request: StepRequest, fault: str) -> Stage:
        """Update phase and fault; return the stage of the last step."""
        previous = self.phase
        if self.standstill:
            request = replace(request, enabled=False)
        self.phase = next_phase(
            previous, request, not fault, self._limiter.at_rest, self._patience
        )
        if fault:
            self.fault = fault
        elif self.phase.stage is not Stage.FAULT and not self.phase.ends_in_fault:
            self.fault = self.standstill
        return previous.stage

    def _control_step(self, reading: Reading, goal: Goal) -> Actions:
        """Do one control step: estimate, plan, act, limit, send.

        Returns:
            The command that the robot sent [m or N], shape (modules, cables).
        """
        began = time.perf_counter()
        with self._controller_errors("feedback"):
            self.driver.feedback = self.feedback.share
        estimate = self._ask("estimate", reading, self._limiter.command)
        plan = self._ask("plan", estimate, goal)
        desired = self._checked_command(self._ask("act", plan, estimate))
        self._monitor_vibration(desired, reading, goal)
        self._tick_time = time.perf_counter() - began
        self._notice_standstill()
        command = self._limiter.limit(self._allowed(desired))
        sent = self._send(command)
        if self._limiter.changed(desired):
            self._ask("sent", command)
        return sent

    def _diagnostics(self) -> dict[str, np.ndarray]:
        """Copies of the controller's telemetry, and the share of the feedback."""
        with self._controller_errors("diagnostics"):
            telemetry = dict(self.driver.diagnostics())
            columns = {name: np.array(value) for name, value in telemetry.items()}
        self._check_columns(columns)
        columns["feedback"] = np.asarray(self.feedback.share)
        return columns

    def _check_columns(self, columns: Mapping[str, np.ndarray]) -> None:
        """Refuse telemetry that would replace what the loop records."""
        for name in columns:
            is_text = isinstance(name, str)
            if not is_text or name in OWN_COLUMNS or name.startswith(SENSOR):
                raise ControllerError(
                    f"{self._failure(self.driver, 'diagnostics')}: {name!r} is no name "
                    "for a controller's own telemetry; choose a text other than "
                    f"{', '.join(sorted(OWN_COLUMNS))}, without '{SENSOR}' before it"
                )

    def _monitor_vibration(
        self, desired: Actions, reading: Reading, goal: Goal
    ) -> None:
        """Lower the feedback while the arm vibrates, and let it return afterwards."""
        if not self._monitors_vibration:
            return
        vibration = self._monitor.update(desired, reading, goal)
        period = self.arm.control_period
        self.feedback = self.feedback.after(vibration is not None, period)
        self.vibration = str(vibration or "")

    def _allowed(self, desired: Actions) -> Actions:
        """The desired command, or the last one while the arm is held."""
        is_held = self.feedback.is_held or self.standstill
        return self._limiter.hold() if is_held else desired

    def _passive_step(self) -> Actions:
        """Hold the last command, or move toward rest; the driver does not act."""
        self._tick_time = 0.0
        if self.phase.stage is Stage.RELEASE:
            desired = self._limiter.towards_rest()
        else:
            desired = self._limiter.hold()
        return self._send(self._limiter.limit(desired))

    def _goal(self, request: StepRequest) -> Goal:
        """The goal of a step: none while the arm is held."""
        if self.phase.stage is Stage.HOLD or request.goal is None:
            return self._no_goal
        return request.goal

    def _is_passive(self, fault: str) -> bool:
        """Whether the controller does not act in this step."""
        is_held = bool(fault or self.standstill)
        return is_held or self.phase.stage not in (Stage.RUN, Stage.HOLD)

    def _read(self) -> Reading:
        return self._checked_reading("read", self._call("read"))

    def _checked_reading(self, method: str, answer: Any) -> Reading:
        """The answer of a robot, if it is a reading with a time.

        Raises:
            RobotError: it is not; the values of sensors are checked later.
        """
        if not isinstance(answer, Reading):
            raise self._robot_error(method, f"it returned {answer!r}, not a Reading")
        moment = np.asarray(answer.time)
        if moment.dtype.kind not in "fiu" or moment.shape:
            text = (
                f"the time of its reading is {answer.time!r}, not a number of seconds"
            )
            raise self._robot_error(method, text)
        if not isinstance(answer.fault, str):
            text = f"the fault of its reading is {answer.fault!r}, not a text"
            raise self._robot_error(method, text)
        return answer

    def _send(self, command: Actions) -> Actions:
        """Send a command; return what the robot sent [m or N] after one period."""
        self._commanded_at = self._clock.with_sleep()
        try:
            # its own copy, which it may change
            answer = self._call("send", command.copy())
        except BaseException:
            self._limiter.not_sent()
            raise
        try:
            sent = np.array(answer, dtype=float)
        except (TypeError, ValueError) as error:
            raise self._robot_error("send", f"it returned {answer!r}") from error
        if sent.shape != command.shape or not np.isfinite(sent).all():
            text = f"it returned {answer!r}, not the action that it sent"
            raise self._robot_error("send", text)
        excess = self._following.find_excess(sent, command)
        if (
            excess and not self._stopped
        ):  # on the way to rest there is no better command
            raise self._robot_error("send", excess)
        self._following.sent(sent)
        with self._robot_errors("advance"):
            self._robot.advance(self.arm.control_period)
        return sent

    def _call(self, method: str, *arguments: Any) -> Any:
        """Call a method of the robot; a call that blocks is a fault of the next step.

        Raises:
            RobotError: the method raised an error that is none of this package.
        """
        began = self._clock.now()
        with self._robot_errors(method):
            answer = getattr(self._robot, method)(*arguments)
        elapsed = self._clock.now() - began
        if elapsed > BLOCKED_PERIODS * self.arm.control_period:
            self.blocked_steps += 1
            name = type(self._robot).__name__
            self._blocked = f"{name}.{method} blocked for {elapsed:.1f} s"
        return answer

    def _ask(self, method: str, *arguments: Any) -> Any:
        """Call a method of the controller.

        Raises:
            ControllerError: the method raised an error that is none of this package.
        """
        with self._controller_errors(method):
            return getattr(self.driver, method)(*arguments)

    def _declared_sensors(self) -> dict[str, Sensor]:
        with self._robot_errors("sensors"):
            declared = dict(self._robot.sensors)
        for name, sensor in declared.items():
            if not isinstance(sensor, Sensor):
                text = f"'{name}' is {sensor!r}, not a Sensor"
                raise self._robot_error("sensors", text)
        return declared

    def _robot_error(self, method: str, text: str) -> RobotError:
        return RobotError(f"{self._failure(self._robot, method)}: {text}")

    def _robot_errors(self, method: str) -> AbstractContextManager[None]:
        return named_errors(RobotError, self._failure(self._robot, method))

    def _controller_errors(self, method: str) -> AbstractContextManager[None]:
        return named_errors(ControllerError, self._failure(self.driver, method))

    def _failure(self, failed: object, method: str) -> str:
        return f"{type(failed).__name__}.{method} failed in step {self._step_count}"


@contextmanager
def _ignored_interrupts() -> Iterator[None]:
    # only the main thread receives signals
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name, None) for name in INTERRUPTS]
    handlers = {
        number: signal.signal(number, signal.SIG_IGN) for number in numbers if number
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            # None if the handler was not set from Python
            signal.signal(number, handler or signal.SIG_DFL)
