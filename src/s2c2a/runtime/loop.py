"""The loop between a body and what drives it: read, check, decide, limit, send; at a fixed rate, on every path to rest.

`run`, `collect` and the live page drive arms through it alike. Whatever a sensor, a
plan or a network says, the command that reaches the body is limited in value, rate and
acceleration (`CommandLimits`), and an arm whose readings cannot be believed is held,
then led to rest (`stages`).
"""

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Literal, Protocol, Self

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.robots import Robot
from s2c2a.runtime.clock import Clock, StepClock, WallClock
from s2c2a.runtime.limits import CommandLimits
from s2c2a.runtime.readings import ReadingCheck
from s2c2a.runtime.record import Step
from s2c2a.runtime.stages import Ask, Patience, Phase, failed, next_phase, released
from s2c2a.spaces import FOLLOWS_FROM, Actions, Reading, Stage

LATE = 0.1  # of a period: a step that begins later than that is late
AT_REST = ALLOWED = 1e-6  # of the full bend


class Driver(Protocol):
    """What decides on actions; a strategy is one."""

    @property
    def arm(self) -> ArmSpec:
        """The arm that it drives."""

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that it needs."""

    def start(self, reading: Reading) -> None:
        """Begin from an arm at rest."""

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """The action of one control step [m or N], shape (modules, cables)."""

    def sent(self, action: Actions) -> None:
        """Told where another action was sent in place of the last one, since a limit did not allow it."""

    def diagnostics(self) -> Mapping[str, np.ndarray]:
        """What it made of the last step, by the names of an episode's columns, such as `planned`."""


class Loop:
    """Drives a body, one `tick` a control period; a context that ends with the arm at rest and closed.

    Attributes:
        arm: that is driven.
        driver: what decides; may be changed while the arm is at rest.
        phase: stage, and what it remembers.
        fault: why the arm stands still, or what was last wrong with a reading.
        late_steps: how many steps began late.
    """

    def __init__(
        self,
        robot: Robot,
        driver: Driver,
        clock: Clock | None = None,
        limits: CommandLimits | None = None,
        patience: Patience | None = None,
        when_late: Literal["skip", "catch up"] = "skip",
        watch: Callable[[Step], None] = lambda step: None,
        faults: Callable[[Reading], Reading] = lambda reading: reading,
    ):
        """A loop whose arm is not open yet.

        Args:
            robot: the body.
            driver: what decides on actions.
            clock: the wall's for a body that shares its time, else as fast as the body
                can.
            limits: of commands; the arm's own if None.
            patience: with readings, and with nobody attending.
            when_late: whether steps that were missed are left out, or made up for as
                fast as can be.
            watch: told of every step; it must be quick.
            faults: what is made of readings before anybody sees them, for trying out.

        Raises:
            S2C2AError: the driver is for another arm, or needs a sensor that the body
                has not.
        """
        self.arm = robot.arm
        self.driver = driver
        self._robot = robot
        self._clock = clock or (StepClock() if robot.own_time else WallClock())
        self._limits = limits or CommandLimits.of(self.arm)
        self._patience = patience or Patience.of(self.arm.control_rate)
        self._when_late = when_late
        self._watch = watch
        self._faults = faults
        self.phase = Phase()
        self.fault = ""
        self.late_steps = 0
        self._number = 0
        self._nothing = Goal.of(self.arm.module_count)
        self._command = self._limits.rest
        self._broken = False
        self._begun = 0.0
        self._due = 0.0
        self.use(driver)

    def use(self, driver: Driver) -> None:
        """Let something else decide from now on; it begins when the arm next runs from rest.

        Raises:
            S2C2AError: as above.
        """
        needed = self.needed_by(driver)
        self.driver = driver
        self._check = ReadingCheck(self._robot.sensors, needed, self.arm.control_period)

    def needed_by(self, driver: Driver) -> list[str]:
        """Names of the sensors that have to be sound for something that decides.

        Raises:
            S2C2AError: as above.
        """
        theirs, ours = (
            (arm.module_count, arm.cable_count) for arm in (driver.arm, self.arm)
        )
        if theirs != ours:
            raise S2C2AError(
                f"made for {theirs} modules and cables each, and '{self.arm.name}' has {ours}"
            )
        sensors = self._robot.sensors
        needed = [
            name if name in sensors else FOLLOWS_FROM.get(name, name)
            for name in driver.sensors
        ]
        if lacking := [name for name in needed if name not in sensors]:
            raise S2C2AError(
                f"{', '.join(lacking)} is needed, and this body says {', '.join(sensors) or 'nothing'}; "
                "change `sensing` in the arm file, or the body"
            )
        return needed

    def open(self) -> None:
        """Open the body, at rest; called again, it begins anew."""
        first = self._robot.open()
        self._check.begin()
        self._command = self._before = self._limits.rest.copy()
        self._change = np.zeros_like(self._limits.rest)
        self.phase = Phase()
        self.fault = ""
        self._broken = False
        self._due = self._clock.now()
        self._begun = self._due - first.time

    def tick(self, ask: Ask) -> Step:
        """One control step, when it is due.

        Raises:
            Exception: whatever the body or the driver raises; the arm stands still
                then, until it is opened again.
        """
        if self._broken:
            raise S2C2AError(self.fault)
        moment, late = self._wait()
        try:
            reading = self._faults(self._robot.read())
            fault = self._fault_of(reading, moment)
            before = self.phase
            self.phase = next_phase(
                before, ask, not fault, self._at_rest(), self._patience
            )
            if fault or self.phase.stage is not Stage.FAULT:
                self.fault = fault or (self.fault if self.phase.spoiled else "")
            began = time.perf_counter()
            desired = self._desired(
                reading, ask, fault, starts=before.stage in (Stage.IDLE, Stage.START)
            )
            tick_time = time.perf_counter() - began
            sent = self._send(desired)
            active = self.phase.stage in (Stage.RUN, Stage.HOLD) and not fault
            if (
                active
                and not self._limits.sizes(self._command - desired).max() <= ALLOWED
            ):
                self.driver.sent(self._command)
            told = dict(self.driver.diagnostics()) if active else {}
        except BaseException as error:
            self.stop(error)
            raise
        step = Step(
            self._number,
            moment,
            self.phase.stage,
            reading,
            ask.goal,
            sent,
            told,
            tick_time,
            late,
            self.fault,
        )
        self._number += 1
        self._watch(step)
        return step

    def stop(self, error: BaseException) -> None:
        """Stand still for a reason, until the arm is opened again."""
        self.phase = failed(self.phase)
        self.fault = str(error) or type(error).__name__
        self._broken = True

    def release(self) -> None:
        """Lead the arm to rest, no faster than its limits; needs no reading, and takes its time."""
        self.phase = released(self.phase)

    def to_rest(self) -> Iterator[Step]:
        """Release, and tick until the arm is at rest; the steps that it takes."""
        self.release()
        while self.phase.stage is Stage.RELEASE:
            yield self.tick(Ask(asked=False))

    def close(self) -> None:
        """Lead an arm of metal to rest as far as that goes, whatever it reads, and close it; on every path out.

        A second interrupt does not leave it bent: none is heard meanwhile.
        """
        self._due = self._clock.now()
        with _deaf_to_interrupts():
            try:
                # a body that fails on the way to rest is closed all the same
                with suppress(Exception):
                    while not (self._robot.own_time or self._at_rest()):
                        self._wait()
                        self._send(self._next_to_rest())
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

    def _wait(self) -> tuple[float, float]:
        """Until the next step is due; when that is, and how late it has become."""
        self._clock.wait_until(self._due)
        now = self._clock.now()
        period = self.arm.control_period
        late = max(now - self._due, 0.0)
        self.late_steps += late > LATE * period
        self._due += period * (
            1 if self._when_late == "catch up" else 1 + int(late / period)
        )
        return now, late

    def _fault_of(self, reading: Reading, moment: float) -> str:
        """What is wrong with a reading; one of a body with a time of its own cannot be late."""
        now = reading.time if self._robot.own_time else moment - self._begun
        return self._check.fault(
            reading, now, float(self._limits.sizes(self._change).max())
        )

    def _at_rest(self) -> bool:
        return bool(
            (self._limits.sizes(self._command - self._limits.rest) < AT_REST).all()
        )

    def _desired(self, reading: Reading, ask: Ask, fault: str, starts: bool) -> Actions:
        """The command that the stage asks for, before its limits."""
        stage = self.phase.stage
        if stage is Stage.RELEASE:
            return self._next_to_rest()
        if stage not in (Stage.RUN, Stage.HOLD) or fault:
            self._before = self._command  # nobody's plan, which would have jumped here
            return self._command
        if stage is Stage.RUN and starts:
            self.driver.start(reading)
        goal = ask.goal if stage is Stage.RUN else None
        return self.driver.step(reading, self._nothing if goal is None else goal)

    def _next_to_rest(self) -> Actions:
        self._before = self._command
        return self._limits.towards_rest(self._command, self._change)

    def _send(self, desired: Actions) -> Actions:
        """Send a command within its limits, and let the body's own time pass; what was really sent."""
        command = self._limits.limited(
            desired, self._command, self._change, self._before
        )
        self._change = command - self._command
        self._command = command
        self._before = desired
        sent = np.asarray(self._robot.send(command), dtype=float)
        self._robot.advance(self.arm.control_period)
        return sent


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():  # others hear none
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        # None where it was not set from Python
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)
