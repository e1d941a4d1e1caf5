"""A strategy: sense, plan, act (Chen et al. 2025, fig. 1C)."""

import operator
from typing import Protocol

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.control import Controller
from s2c2a.errors import StrategyError
from s2c2a.planning import Goal, Plan, Planner
from s2c2a.programs import compiled
from s2c2a.runtime import Driver
from s2c2a.sensing import Estimator
from s2c2a.spaces import Actions, Configurations, Reading, States


class AnyStrategy(Driver, Protocol):
    """What every strategy can do, beside driving an arm; `Strategy` says it in full."""

    @property
    def name(self) -> str:
        """Such as "s2c2a"."""


class Strategy:
    """Estimator, planner and controller of one arm, and what they carry from step to step.

    Nothing compiles after the strategy is built.

    Attributes:
        name: such as "s2c2a".
        arm: the arm that it drives.
        sensors: names of the sensors that it needs.
    """

    def __init__(self, name: str, arm: ArmSpec, estimator: Estimator, planner: Planner, controller: Controller):
        """Put the parts together and compile them."""
        self.name, self.arm, self.sensors = name, arm, estimator.sensors
        self._estimator, self._planner = estimator, planner
        self._plan: Plan | None = None
        self._sense = compiled(operator.call, estimator)
        self._start_control = compiled(_start_control, controller)
        self._act = compiled(_act, controller)
        self._after = compiled(_after, controller)
        self._warm_up()

    def start(self, reading: Reading) -> None:
        """Begin from an arm at rest.

        Raises:
            StrategyError: the sensors gave no finite numbers.
        """
        self._sensed = self._sensed_in(reading)
        self._plan = self._planner.start(self._sensed)
        self._memory = self._start_control(self._sensed)

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """The action of one control step.

        Args:
            reading: the latest.
            goal: for the state after the action.

        Raises:
            StrategyError: it was not started, or the sensors gave no finite numbers; the next reading may be better.

        Returns:
            Displacements [m] or tensions [N], shape (modules, cables).
        """
        if self._plan is None:
            raise StrategyError("this strategy was not started; call start(reading) with the arm at rest first")
        self._sensed = self._sensed_in(reading)
        self._plan = self._planner.plan(self._plan, self._sensed, goal)
        action, self._memory = self._act(self._plan.configurations, self._sensed, self._memory)
        return np.asarray(action, dtype=np.float64)

    def sent(self, action: Actions) -> None:
        """An action was sent in place of the last one, which a limit did not allow."""
        self._memory = self._after(np.asarray(action, np.float32), self._memory)

    @property
    def sensed(self) -> Configurations:
        """The latest sensed configuration, shape (modules, 3)."""
        return np.asarray(self._sensed)

    @property
    def planned(self) -> Configurations:
        """The latest planned configuration, shape (modules, 3)."""
        if self._plan is None:
            raise StrategyError("this strategy was not started; it has planned nothing yet")
        return np.asarray(self._plan.configurations)

    @property
    def expected(self) -> States:
        """The states that the latest plan is expected to lead to, shape (modules, 6), base frame.

        Raises:
            StrategyError: it was not started.
        """
        if self._plan is None:
            raise StrategyError("this strategy was not started; it expects nothing yet")
        return np.asarray(self._planner.predicted(self._plan), dtype=float)

    def told(self) -> dict[str, np.ndarray]:
        """What it sensed, planned and expects, by column of an episode."""
        return {"sensed": self.sensed, "planned": self.planned, "expected": self.expected}

    def _sensed_in(self, reading: Reading):
        sensed = self._sense(self._estimator.inputs(reading))
        if not np.isfinite(np.asarray(sensed)).all():  # it would stay in what planner and controller remember
            raise StrategyError("the sensors gave no finite numbers; nothing was planned, and the arm was not moved")
        return sensed

    def _warm_up(self) -> None:
        """Compile; what the sensors say does not matter, and of sensors that are not known here nothing is said."""
        straight = np.tile([0.0, 0.0, 1.0], (self.arm.module_count, 1))
        known = {"cables": np.zeros((self.arm.module_count, self.arm.cable_count)), "configurations": straight}
        if set(self.sensors) <= set(known):
            self.start(Reading(0.0, known))
            self.step(Reading(0.0, known), Goal.of(self.arm.module_count))
            self.sent(known["cables"])
            self.told()
        self._plan = None


def _start_control(controller: Controller, sensed):
    return controller.start(sensed)


def _after(controller: Controller, action, memory):
    return controller.sent(action, memory)


def _act(controller: Controller, wanted, sensed, memory):
    return controller.act(wanted, sensed, memory)
