"""A strategy: estimate, plan, act (Chen et al. 2025, fig. 1C)."""

from typing import Any

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.control import Controller
from s2c2a.errors import StrategyError
from s2c2a.estimation import Estimate, StateEstimator
from s2c2a.execution.compilation import compiled
from s2c2a.planning import Goal, Plan, Planner, plan_error
from s2c2a.runtime.driver import choose
from s2c2a.spaces import Actions, Reading


class Strategy:
    """State estimator, planner and controller of one arm.

    The control loop (`runtime.Loop`) calls `estimate`, `plan` and `act` in every control
    step. Building it compiles them; an estimator that uses more sensors than encoders is
    compiled by `start`.

    Attributes:
        name: such as "s2c2a".
        arm: that it drives.
        sensors: names of the sensors that every reading must hold.
        estimator: from readings to the state.
        planner: from state and goal to the next configuration.
        controller: from the planned configuration to the command.
    """

    def __init__(
        self,
        name: str,
        arm: ArmSpec,
        estimator: StateEstimator,
        planner: Planner,
        controller: Controller,
    ):
        """Compose the three parts and compile them.

        Args:
            name: such as "s2c2a".
            arm: that is driven.
            estimator: from readings to the state.
            planner: from state and goal to the next configuration.
            controller: from the planned configuration to the command.
        """
        self.name = name
        self.arm = arm
        self.sensors = estimator.sensors
        self.estimator = estimator
        self.planner = planner
        self.controller = controller
        self._start_controller = compiled(type(controller).start, controller)
        self._act = compiled(type(controller).act, controller)
        self._sent = compiled(type(controller).sent, controller)
        self._plan: Plan | None = None
        self._goal = Goal.of(arm.module_count)
        self._estimate: Estimate
        self._controller_memory: Any
        self._command: Actions
        # compile everything; readings of a user's own sensors are not known here
        modules = self.arm.module_count
        straight = np.tile(np.array([0.0, 0.0, 1.0]), (modules, 1))
        cables = np.zeros((modules, self.arm.cable_count))
        reading = Reading(0.0, {"cables": cables, "configurations": straight})
        if set(self.sensors) <= set(reading.sensors):
            self._begin(self.estimator.start(reading))
            estimate = self.estimate(reading, cables)
        else:
            estimate = Estimate.of(straight)
            self._begin(estimate)
        self.act(self.plan(estimate, Goal.of(modules)), estimate)
        self.sent(cables)
        self.diagnostics()
        self._plan = None

    def __repr__(self) -> str:
        """Name, arm and parts, whose arrays are too many to read."""
        parts = self.estimator, self.planner, self.controller
        kinds = ", ".join(type(part).__name__ for part in parts)
        sensors = ", ".join(self.sensors)
        return f"<Strategy {self.name} on {self.arm.name}: {kinds}; sensors {sensors}>"

    def start(self, reading: Reading) -> None:
        """Begin with an arm at rest.

        Raises:
            StrategyError: the sensors gave no finite numbers.
        """
        self._begin(_checked(self.estimator.start(reading)))

    def estimate(self, reading: Reading, last_command: Actions) -> Estimate:
        """The state of the arm after a reading.

        Args:
            reading: the latest.
            last_command: that was sent in the last control step [m or N], shape
                (modules, cables).

        Raises:
            StrategyError: the strategy was not started, or the sensors gave no finite
                numbers; the next reading may be better.
        """
        self._check_started()
        estimate = self.estimator.update(self._estimate, reading, last_command)
        self._estimate = _checked(estimate)
        return self._estimate

    def plan(self, estimate: Estimate, goal: Goal) -> Plan:
        """The next configuration.

        Args:
            estimate: of the arm's state.
            goal: for the state after the next command.
        """
        self._plan = self.planner.plan(self._check_started(), estimate, goal)
        self._goal = goal
        return self._plan

    def act(self, plan: Plan, estimate: Estimate) -> Actions:
        """The command that leads to the planned configuration.

        Returns:
            Displacements [m] or tensions [N], shape (modules, cables).
        """
        command, self._controller_memory = self._act(
            plan.configurations, estimate.configuration, self._controller_memory
        )
        self._command = np.asarray(command, dtype=np.float64)
        return self._command

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """Estimate, plan and act, for callers without a control loop.

        Raises:
            StrategyError: see `estimate`.
        """
        self._check_started()
        return choose(self, reading, self._command, goal)

    def sent(self, action: Actions) -> None:
        """Learn that a limit changed the last command into another one [m or N]."""
        self._command = action
        self._controller_memory = self._sent(
            np.asarray(action, np.float32), self._controller_memory
        )

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Estimate, plan and prediction of the last step, by column of an episode.

        | column           | meaning                                       | shape        |
        | ---------------- | --------------------------------------------- | ------------ |
        | `sensed`         | measured configurations, module frames        | (modules, 3) |
        | `planned`        | planned configurations                        | (modules, 3) |
        | `predicted`      | states that the plan leads to [m, 1]          | (modules, 6) |
        | `predictive_std` | standard deviation of the predicted ends [m]  | (modules,)   |
        | `extrapolation`  | the part of it due to missing data [m]        | ()           |
        | `outcome`        | of the planner (`planning.Outcome`)           | ()           |
        | `plan_error`     | of the predicted ends from their goal [m]     | ()           |
        | `horizon`        | tip that is planned ahead [m], if it is       | (moments, 3) |

        The estimator adds its own (`Estimate.diagnostics`).

        Raises:
            StrategyError: the strategy was not started.
        """
        plan = self._check_started()
        expectation = plan.expectation
        ahead = {}
        if expectation.horizon is not None:
            ahead["horizon"] = np.asarray(expectation.horizon, dtype=float)
        return (
            self._estimate.diagnostics()
            | ahead
            | {
                "planned": np.asarray(plan.configurations),
                "predicted": np.asarray(expectation.states, dtype=float),
                "predictive_std": np.asarray(expectation.predictive_std),
                "extrapolation": np.asarray(expectation.extrapolation),
                "outcome": np.asarray(plan.outcome),
                "plan_error": np.asarray(plan_error(expectation.states, self._goal)),
            }
        )

    def set_real_time(self, is_real: bool) -> None:
        """See `Planner.set_real_time`."""
        self.planner.set_real_time(is_real)

    def _begin(self, estimate: Estimate) -> None:
        self._estimate = estimate
        self._plan = self.planner.start(estimate)
        self._goal = Goal.of(self.arm.module_count)
        self._controller_memory = self._start_controller(estimate.configuration)
        self._command = ArmGeometry.of(self.arm).action_neutral

    def _check_started(self) -> Plan:
        if self._plan is None:
            raise StrategyError(
                "this strategy was not started; call start(reading) with the arm at rest"
            )
        return self._plan


def _checked(estimate: Estimate) -> Estimate:
    """Refuse numbers that would stay in the memory of planner and controller.

    Raises:
        StrategyError: the configuration is not finite.
    """
    if not np.isfinite(np.asarray(estimate.configuration)).all():
        raise StrategyError(
            "the sensors gave no finite numbers; nothing was planned or sent"
        )
    return estimate
