"""Control loop: read, check, decide, limit, and send, at a fixed rate.

Every arm, simulated or real, is driven by `Loop.tick`, once a control period. Whatever
a sensor, a plan, or a network outputs, the command that reaches the robot is limited in
value, rate, and acceleration (`CommandLimits`). An arm whose readings fail the check is
held, then moved to rest (`stages`). However the loop ends, it ends at rest.

Robots and controllers may be anybody's: what they get and return is copied, so that they
cannot change what the loop remembers, and their exceptions become errors that name them.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, Self

import numpy as np

from s2c2a.errors import RobotError, S2C2AError, TargetError
from s2c2a.goals import Goal
from s2c2a.measurements.following import FollowingMonitor
from s2c2a.measurements.readings import ReadingCheck
from s2c2a.robots import Robot
from s2c2a.runtime.border import attribute, check_goal
from s2c2a.runtime.checked import CheckedDriver, CheckedRobot
from s2c2a.runtime.clock import Clock, StepClock, WallClock
from s2c2a.runtime.driver import Driver, choose
from s2c2a.runtime.emergency import EMERGENCY_STOP, EmergencyStop, EmergencyStopError
from s2c2a.runtime.interrupts import ignored_interrupts
from s2c2a.runtime.limits import CommandLimiter, CommandLimits, arm_at
from s2c2a.runtime.record import StepRecord
from s2c2a.runtime.stages import Patience, Phase, StepRequest, next_phase, with_release
from s2c2a.spaces import Actions, Reading, Stage

LATE = 0.1  # of a control period, for a count of late steps alone


class Loop:
    """Control loop of one robot: one `tick` a control period.

    A context manager that opens the robot, and in the end moves it to rest and closes
    it.

    Attributes:
        arm: arm of the robot.
        phase: stage of the arm and its counters.
        fault: reason of a stop, or fault of the latest reading; empty without one.
        standstill: how long the program stood still, while the arm is held for that
            reason; empty otherwise.
        late_steps: number of steps that began late.
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
        emergency_stop: EmergencyStop = EMERGENCY_STOP,
        rate: float | None = None,
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
            emergency_stop: ends the motion within one control step; the robot then
                stays where it is, or is released (`Robot.halt`).
            rate: of the control steps [Hz]; that of the arm by default.

        Raises:
            S2C2AError: the controller is for another arm, or requires a sensor that
                the robot lacks.
        """
        arm = attribute(robot, "arm", RobotError)
        self.arm = arm if rate is None else arm_at(arm, rate)
        self._period = self.arm.control_period
        self._patience = patience or Patience.of(self.arm.control_rate)
        self._on_step = on_step
        self._faults = faults
        self._no_goal = Goal.of(self.arm.module_count)
        self._limits = limits or CommandLimits.of(self.arm)
        own_time = attribute(robot, "own_time", RobotError)
        self._clock = clock or (StepClock() if own_time else WallClock())
        self._robot = CheckedRobot(
            robot, self._clock, robot.arm.control_period, lambda: self._step_count
        )
        self._due = 0.0
        self._opened_at = 0.0
        self._commanded_at = np.inf
        self._step_count = 0
        self._tick_time = 0.0
        self.late_steps = 0
        self.phase = Phase()
        self._following = FollowingMonitor(self.arm)
        self._sensing = sensing
        self._emergency_stop = emergency_stop
        self._halted = False
        self.use(driver)
        self._reset()

    def use(self, driver: Driver) -> None:
        """Change the controller; it starts when the arm next runs from rest.

        Raises:
            S2C2AError: see `Loop`.
        """
        required = self.required_sensors(driver)
        self._checked_driver = self._checked(driver)
        self.prepare(driver)
        self._check = ReadingCheck(
            self._robot.sensors,
            required,
            self._robot.robot.arm.control_period,
            self._following,
            # a motion may command more often than the arm's sensors measure
            steps=max(
                1, round(self.arm.control_rate / self._robot.robot.arm.control_rate)
            ),
        )

    def prepare(self, driver: Driver) -> None:
        """Let a controller compile what it needs for the clock of this loop.

        `use` does it, too; a loop that runs needs it done before, in another thread.
        """
        is_real = not isinstance(self._clock, StepClock)
        self._checked(driver).set_real_time(is_real)

    @property
    def driver(self) -> Driver:
        """Controller; it may be replaced (`use`) while the arm is at rest."""
        return self._checked_driver.driver

    @property
    def driver_name(self) -> str:
        """Name of the controller in records; that of its class if it has none."""
        return self._checked_driver.name

    def required_sensors(self, driver: Driver) -> list[str]:
        """Return the names of the robot's sensors that a controller requires.

        Raises:
            S2C2AError: see `Loop`.
        """
        return self._checked(driver).required_sensors(self._robot.sensors)

    def _checked(self, driver: Driver) -> CheckedDriver:
        return CheckedDriver(driver, self.arm, lambda: self._step_count)

    def open(self) -> None:
        """Open the robot at rest; a second call starts again from there.

        Raises:
            EmergencyStopError: the emergency stop has not been reset.
            RobotError: the robot failed.
        """
        self._emergency_stop.check()
        first_reading = self._robot.open()
        self._reset()
        self._due = self._clock.now()
        self._opened_at = self._due - first_reading.time

    def tick(self, request: StepRequest) -> StepRecord:
        """Wait for the next control step and do it.

        Raises:
            TargetError: see `check_goal`; the step is not done.
            S2C2AError: any error of the robot or the controller; the arm then stays
                stopped until it is opened again.
        """
        if self._stopped:
            raise S2C2AError(self.fault)
        if not isinstance(request, StepRequest):
            raise TargetError(f"tick() needs StepRequest(goal), got {request!r:.99}")
        if request.goal is not None:
            check_goal(request.goal, self.arm)
        moment, delay = self._wait()
        try:
            self._emergency_stop.check()
            reading = self._faults(self._robot.read())
            self._notice_standstill()
            # describe a blocked call or an unsound reading; in simulation, none is too
            # old
            now = reading.time if self._robot.own_time else moment - self._opened_at
            fault = self._robot.take_fault() or self._check.find_fault(
                reading, now, self._limiter.last_change
            )
            if not fault:
                reading = self._sensing(reading)
            previous_stage = self._update_stage(request, fault)
            is_held = fault or self.standstill
            if is_held or self.phase.stage not in (Stage.RUN, Stage.HOLD):
                # hold the last command, or move toward rest; the driver does not act
                self._tick_time = 0.0
                if self.phase.stage is Stage.RELEASE:
                    desired = self._limiter.towards_rest()
                else:
                    desired = self._limiter.hold()
                sent = self._send(self._limiter.limit(desired))
                diagnostics = {}
            else:
                if previous_stage in (Stage.IDLE, Stage.START):
                    # an arm at rest may wait for a controller that compiles
                    self._commanded_at = np.inf
                    self._checked_driver.start(reading)
                # none while the arm is held
                goal = request.goal if self.phase.stage is Stage.RUN else None
                sent = self._control_step(reading, goal or self._no_goal)
                diagnostics = self._checked_driver.diagnostics()
        except BaseException as error:
            self.stop(error)
            raise
        record = StepRecord(
            self._step_count, moment, self.phase.stage, reading, request.goal, sent,
            diagnostics, self._tick_time, delay, self.fault,
        )  # fmt: skip
        self._step_count += 1
        self._on_step(record)
        return record

    def stop(self, error: BaseException) -> None:
        """Stop the arm where it is because of an error, until it is opened again."""
        self.phase = replace(self.phase, stage=Stage.FAULT)
        self.fault = str(error) or type(error).__name__
        self._stopped = True
        if isinstance(error, EmergencyStopError):
            self._halted = True
            self._robot.halt()

    def resume(self) -> None:
        """Let an arm go on that is held because the program stood still.

        Whoever calls it makes sure that the arm may move.
        """
        self.standstill = ""
        self._commanded_at = self._clock.with_sleep()

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
        with ignored_interrupts():
            try:
                self._go_to_rest()
            finally:
                self._robot.close()

    def __enter__(self) -> Self:
        try:
            self.open()
        except BaseException:
            self._robot.close()
            raise
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def _go_to_rest(self) -> None:
        """Move to rest past failures, until too many follow each other.

        Simulations move to rest only after errors.
        """
        failures = 0
        while not (self._halted or self._limiter.at_rest):
            if self._robot.own_time and not self._stopped:
                return
            try:
                # wait, and send the next command on the way to rest
                self._wait()
                try:
                    self._emergency_stop.check()
                except EmergencyStopError as error:
                    self.stop(error)
                    raise
                way = self._limiter.towards_rest()
                self._send(self._limiter.limit(way), closes=True)
                failures = 0
            # of the robot, which may also call `exit`; the next step may succeed
            except (Exception, SystemExit):
                failures += 1
            if failures >= self._patience.unsound:
                return

    def _reset(self) -> None:
        self._check.reset()
        self._following.reset()
        self._limiter = CommandLimiter(self._limits)
        self._robot.take_fault()  # that of a call before belongs to no step
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
        period = self._period
        delay = max(now - self._due, 0.0)
        self.late_steps += delay > LATE * period
        self._due += period * (1 + int(delay / period))
        return now, delay

    def _notice_standstill(self) -> None:
        """Hold a real arm in motion that had no command for too long."""
        if self._robot.own_time or self.phase.stage not in (Stage.RUN, Stage.HOLD):
            return
        pause = self._clock.with_sleep() - self._commanded_at
        if pause <= self._period + self._patience.standstill:
            return
        self.standstill = f"the program stood still for {pause:.1f} s"
        self.phase = replace(self.phase, stage=Stage.HOLD)
        self.fault = self.standstill

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
        driver = self._checked_driver
        began = time.perf_counter()
        desired = choose(driver, reading, self._limiter.command, goal)
        self._tick_time = time.perf_counter() - began
        self._notice_standstill()
        allowed = self._limiter.hold() if self.standstill else desired
        command = self._limiter.limit(allowed)
        sent = self._send(command)
        if self._limiter.changed(desired):
            driver.sent(command)
        return sent

    def _send(self, command: Actions, closes: bool = False) -> Actions:
        """Send a command; return what the robot sent [m or N] after one period.

        Args:
            command: [m or N].
            closes: whether the arm goes to rest before the robot is closed; then there is
                no better command, whatever the robot sends.
        """
        self._commanded_at = self._clock.with_sleep()
        try:
            answer = self._robot.send(command)
        except BaseException:
            self._limiter.not_sent()
            raise
        sent = self._robot.sent_action(answer, command.shape)
        excess = self._following.find_excess(sent, command)
        if excess and not closes:
            raise self._robot.error("send", excess)
        self._following.sent(sent)
        self._robot.advance(self._period)
        return sent
