"""Expert demonstrations: a strategy that shows a task; it knows nothing of LeRobot."""

import numpy as np

from s2c2a.errors import S2C2AError
from s2c2a.runtime.checked import CheckedDriver
from s2c2a.runtime.driver import choose
from s2c2a.runtime.limits import CommandLimiter, CommandLimits
from s2c2a.spaces import Actions
from s2c2a.tasks import load_task

from lerobot_robot_s2c2a.arm import TIP, DrivenArm, strategy_for


class Expert:
    """Chooses the action of every frame for an arm; the task repeats.

    Commands are within the limits of the arm, so that the arm sends them as they are,
    and the dataset holds what was sent.
    """

    def __init__(self, arm: DrivenArm, task: str, weights: str = ""):
        """An expert for an open arm at rest.

        Args:
            arm: that it drives.
            task: a name, a file of waypoints (.csv), or file.py:function.
            weights: of its strategy, without which it is PCC; an arm that follows
                targets of the tip has its own.

        Raises:
            S2C2AError: there is no such task or strategy, the strategy needs another
                sensor, or a target of the tip is needed and the task has none.
        """
        self._arm = arm
        loaded = load_task(task, arm.spec)
        self._goals = list(loaded.shown_goals(arm.spec))
        self._targets = loaded.desired_positions()[:, -1]
        self._frame = 0
        self._started = False
        self._limiter = CommandLimiter(CommandLimits.of(arm.spec))
        if arm.action_space == TIP:
            self._check_targets(task, weights)
            return
        driver = strategy_for(arm.spec, weights)
        self._driver = CheckedDriver(driver, arm.spec, lambda: self._frame)
        self._driver.required_sensors(arm.sensors)
        self._driver.set_real_time(True)

    def action(self) -> dict[str, float]:
        """The action after the latest observation, by name."""
        number = self._frame % len(self._goals)
        if self._arm.action_space == TIP:
            values = self._targets[number]
        else:
            values = self._command(number)
        self._frame += 1
        named = zip(self._arm.action_names, np.ravel(values).tolist(), strict=True)
        return dict(named)

    def _command(self, number: int) -> Actions:
        reading, driver = self._arm.reading, self._driver
        if reading.fault:
            # the arm holds as well
            return self._limiter.hold()
        if not self._started:
            driver.start(reading)
            self._started = True
        desired = choose(driver, reading, self._limiter.command, self._goals[number])
        command = self._limiter.limit(desired)
        if self._limiter.changed(desired):
            driver.sent(command)
        return command

    def _check_targets(self, task: str, weights: str) -> None:
        if weights:
            raise S2C2AError(
                "an arm that follows targets of the tip has a strategy of its own; give "
                "--robot.weights in place of --teleop.weights"
            )
        if not np.isfinite(self._targets).all():
            raise S2C2AError(
                f"the task '{task}' has steps without a target of the tip; choose "
                "another one, or --robot.action_space=cables"
            )
