"""An arm in the control loop, one control step a frame; it knows nothing of LeRobot."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from statistics import median
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.execution import robot_factory_for
from s2c2a.errors import ActionError, RobotError, S2C2AError
from s2c2a.goals import Goal
from s2c2a.robots import Robot
from s2c2a.runtime import Driver, Loop, Patience, StepRequest, WallClock
from s2c2a.runtime.limits import CommandLimits
from s2c2a.spaces import Actions, Reading, Sensor, Stage

COMMANDS, TIP = "cables", "tip"
TIP_NAMES = ("tip.x", "tip.y", "tip.z")
PAUSE = 10.0  # s; saving an episode takes LeRobot less
CHECKED_FRAMES = 20  # enough for a median that one slow frame does not move
SHORTEST = (
    0.9  # of a control period, between two steps; that much faster an arm may move
)
PACE_TOLERANCE = 0.2  # of a control period; pauses of LeRobot's loop vary by less


class Commanded:
    """A driver that returns the commands that it was given.

    Attributes:
        name: in records.
        arm: that it drives.
        sensors: that it requires: none.
        command: the next one [m or N], shape (modules, cables).
    """

    name = "lerobot"
    sensors = ()

    def __init__(self, arm: ArmSpec):
        self.arm = arm
        self.command = CommandLimits.of(arm).rest

    def start(self, reading: Reading) -> None:
        """Begin; nothing depends on the reading."""

    def estimate(self, reading: Reading, last_command: Actions) -> Reading:
        return reading

    def plan(self, estimate: Reading, goal: Goal) -> Goal:
        return goal

    def act(self, plan: Goal, estimate: Reading) -> Actions:
        return self.command

    def sent(self, action: Actions) -> None:
        """Nothing depends on the last command."""

    def diagnostics(self) -> dict[str, np.ndarray]:
        return {}


class Pace:
    """Compares the frames of the first seconds with the control rate.

    A dataset has the wrong times, and a simulated arm another speed, where they differ.
    """

    def __init__(self, rate: float):
        self._rate = rate
        self._periods: list[float] = []

    def add(self, seconds: float) -> None:
        """Add the time since the last frame, without that spent waiting for the arm.

        Raises:
            RobotError: frames come faster than the control steps of the arm.
        """
        self._periods.append(seconds)
        if len(self._periods) != CHECKED_FRAMES:
            return
        ratio = 1.0 / (median(self._periods) * self._rate)
        if 1.0 - PACE_TOLERANCE <= ratio <= 1.0 + PACE_TOLERANCE:
            return
        text = (
            f"LeRobot sends {ratio * self._rate:.1f} frames a second, and the arm is "
            f"controlled at {self._rate:g} Hz; give --dataset.fps={self._rate:g} "
            "(--fps without a dataset)"
        )
        if ratio > 1.0:
            raise RobotError(text)
        logging.warning("%s, or close what slows this computer", text)


class FrameClock(WallClock):
    """The wall clock of a real arm, for which LeRobot sets the pace.

    Two paces, each with a phase of its own, would delay every frame. So the control loop
    waits only where a frame comes too early.
    """

    def __init__(self, period: float):
        self._shortest = SHORTEST * period
        self._last = -np.inf

    def wait_until(self, moment: float) -> None:
        """Return a share of the control period after the last step, or at the moment."""
        super().wait_until(min(moment, self._last + self._shortest))
        self._last = self.now()


class DrivenArm:
    """One arm in the control loop of the package, whose limits every command passes.

    Attributes:
        spec: the arm.
        sensors: of the robot, by name.
        action_space: "cables" or "tip".
        sensor_names: of the numbers of observations.
        action_names: of the numbers of actions.
        reading: latest.
    """

    reading: Reading

    def __init__(
        self,
        robot: Robot,
        sensors: Sequence[str] = (),
        strategy: Driver | None = None,
        now: Callable[[], float] = time.perf_counter,
    ):
        """An arm that is not open yet.

        Args:
            robot: to drive.
            sensors: in observations; by default those that every reading has.
            strategy: follows targets of the tip; actions are commands without.
            now: clock [s].

        Raises:
            S2C2AError: the robot has no such sensor, or the strategy is for another.
        """
        self.spec = robot.arm
        self._robot = robot
        self._commanded = Commanded(robot.arm)
        self.action_space = COMMANDS if strategy is None else TIP
        self.sensors = robot.sensors
        self._sensors = _chosen(self.sensors, sensors)
        self.sensor_names = tuple(
            name for key, each in self._sensors.items() for name in _names(key, each)
        )
        shape = self._commanded.command.shape
        cables = [f"cable.{m + 1}.{c + 1}" for m, c in np.ndindex(shape)]
        self.action_names = tuple(cables) if strategy is None else TIP_NAMES
        self._loop = Loop(
            robot,
            strategy or self._commanded,
            None if robot.own_time else FrameClock(robot.arm.control_period),
            patience=Patience.of(robot.arm.control_rate, standstill=PAUSE),
            # a pose that the observation took from the robot reaches the strategy, too
            faults=self._with_observed,
        )
        self._now = now

    def open(self) -> None:
        """Open the robot at rest.

        Raises:
            S2C2AError: it failed; it is closed then.
        """
        self._pace = Pace(self.spec.control_rate)
        self._last_frame: float | None = None
        self._loop.__enter__()
        self._is_fresh = True
        self.reading = self._robot.read()

    def close(self) -> None:
        """Move a real arm to rest, and close the robot."""
        self._loop.close()

    def observe(self) -> dict[str, float]:
        """Read the sensors; NaN where one measured nothing.

        Raises:
            S2C2AError: the robot failed.
        """
        if self._is_fresh and not self._robot.own_time:
            # networks were loaded meanwhile, and servos stop without commands
            self._loop.open()
        self._is_fresh = False
        self.reading = self._robot.read()
        nothing = {
            name: np.full(sensor.shape, np.nan)
            for name, sensor in self._sensors.items()
        }
        values = nothing | dict(self.reading.sensors)
        numbers = np.concatenate([np.ravel(values[name]) for name in self._sensors])
        return dict(zip(self.sensor_names, numbers.tolist(), strict=True))

    def step(self, action: Mapping[str, Any]) -> dict[str, float]:
        """Do one control step; a simulated arm advances by one control period.

        Args:
            action: numbers by name (`action_names`).

        Returns:
            The commands that were really sent, or the target of the tip.

        Raises:
            ActionError: names are missing or unknown, or a value is no finite number;
                nothing moves.
            RobotError: the arm was stopped, or frames come too fast.
        """
        values = self._values(action)
        began = self._now()
        if self._last_frame is not None:
            self._pace.add(began - self._last_frame)
        goal = None
        if self.action_space == TIP:
            goal = Goal.of(self.spec.module_count).with_position(values)
        else:
            self._commanded.command = values.reshape(self._commanded.command.shape)
        self._record = self._loop.tick(StepRequest(goal))
        stage = self._record.stage
        if self._loop.standstill or stage not in (Stage.START, Stage.RUN, Stage.HOLD):
            raise RobotError(f"the arm was stopped: {self._loop.fault}")
        if self._record.fault:
            logging.warning("the arm is held: %s", self._record.fault)
        sent = values if self.action_space == TIP else self._record.action
        # while the loop waits for a real arm, LeRobot does nothing
        is_simulated = self._robot.own_time
        self._last_frame = began if is_simulated else max(self._record.moment, began)
        return dict(zip(self.action_names, np.ravel(sent).tolist(), strict=True))

    def _values(self, action: Mapping[str, Any]) -> np.ndarray:
        if set(action) != set(self.action_names):
            raise ActionError(
                f"an action has {', '.join(sorted(action))}; this arm takes "
                f"{', '.join(self.action_names)}; nothing was sent"
            )
        try:
            values = np.array([float(action[name]) for name in self.action_names])
        except (TypeError, ValueError) as error:
            raise ActionError(f"an action is no number: {error}") from error
        if not np.isfinite(values).all():
            raise ActionError(f"an action is not finite: {values}; nothing was sent")
        return values

    def _with_observed(self, reading: Reading) -> Reading:
        sensors = {**self.reading.sensors, **reading.sensors}
        return replace(reading, sensors=sensors)


def open_arm(
    arm: str,
    robot: str = "sim",
    options: tuple[str, ...] = (),
    tracking: str = "",
    sensors: tuple[str, ...] = (),
    action_space: str = COMMANDS,
    weights: str = "",
) -> DrivenArm:
    """Prepare an arm; arguments are as in the configuration of the robot.

    Raises:
        S2C2AError: there is no such arm, robot, option, sensor or action space.
    """
    if action_space not in (COMMANDS, TIP):
        raise S2C2AError(
            f"there is no action space '{action_space}'; give {COMMANDS} or {TIP}"
        )
    if weights and action_space == COMMANDS:
        raise S2C2AError(
            "--robot.weights has no effect on commands of cables; give "
            "--robot.action_space=tip, or leave it out"
        )
    spec = load_arm(arm)
    made = robot_factory_for(robot, options, tracking=tracking).make(spec)
    strategy = strategy_for(spec, weights) if action_space == TIP else None
    return DrivenArm(made, sensors, strategy)


def strategy_for(arm: ArmSpec, weights: str) -> Driver:
    """The strategy of a weight file, or PCC without.

    Raises:
        StrategyError: see `s2c2a.load_strategy`.
    """
    from s2c2a import load_strategy  # noqa: PLC0415  # networks take seconds to load
    from s2c2a.strategies import pcc_strategy  # noqa: PLC0415

    return load_strategy(weights, arm) if weights else pcc_strategy(arm)


def _chosen(sensors: Mapping[str, Sensor], names: Sequence[str]) -> dict[str, Sensor]:
    """The sensors of observations.

    Raises:
        S2C2AError: there is no such sensor.
    """
    unknown = sorted(set(names) - set(sensors))
    if unknown:
        raise S2C2AError(
            f"the robot has no sensor {', '.join(unknown)}; it has "
            f"{', '.join(sorted(sensors))}"
        )
    chosen = names or [name for name, sensor in sensors.items() if sensor.always]
    return {name: sensors[name] for name in chosen}


def _names(key: str, sensor: Sensor) -> list[str]:
    """Names of a sensor's numbers, as `s2c2a export` writes them."""
    places = [[str(place + 1) for place in range(size)] for size in sensor.shape]
    if key == "states":
        places[-1] = ["x", "y", "z", "axis_x", "axis_y", "axis_z"]
    return [".".join([key, *place]) for place in product(*places)]
