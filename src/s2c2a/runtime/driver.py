"""What the control loop calls in every step: a strategy, or a player of motions."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.goals import Goal, GoalPart
from s2c2a.spaces import Actions, Reading

EstimateT = TypeVar("EstimateT")
PlanT = TypeVar("PlanT")


class Driver(Protocol[EstimateT, PlanT]):
    """Controller that chooses the action of every control step, such as a strategy.

    Its types are those of its estimates and plans, which the loop only passes on. If it has
    a method `set_real_time(is_real)`, the loop calls it before the arm moves: in real
    time, nothing may compile in a step, and no step may wait.
    """

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

    def estimate(self, reading: Reading, last_command: Actions) -> EstimateT:
        """Estimate the state of the arm.

        Args:
            reading: latest.
            last_command: that was sent in the last step [m or N], shape (modules,
                cables).
        """

    def plan(self, estimate: EstimateT, goal: Goal) -> PlanT:
        """Plan toward a goal."""

    def act(self, plan: PlanT, estimate: EstimateT) -> Actions:
        """Return the command [m or N], shape (modules, cables)."""

    def sent(self, action: Actions) -> None:
        """Receive the command that replaced the last action.

        The loop calls this after every step whose action exceeded a limit.
        """

    def diagnostics(self) -> Mapping[str, np.ndarray]:
        """Return telemetry of the last step, by column of an episode (`planned`)."""


@dataclass(frozen=True)
class StatedDriver:
    """A driver, and what its strategy states of it; all else is the driver's own.

    A user's driver may be frozen, so that nothing is kept on it.

    Attributes:
        driver: that the strategy has built.
        name: of the strategy.
        ignores: parts of goals that it ignores.
    """

    driver: Any
    name: str
    ignores: frozenset[GoalPart]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.driver, name)


def choose(
    driver: Driver[EstimateT, PlanT],
    reading: Reading,
    last_command: Actions,
    goal: Goal,
) -> Actions:
    """Return the command of a control step: estimate, plan, act.

    Args:
        driver: controller, which was started.
        reading: latest.
        last_command: that was sent in the last step [m or N], shape (modules, cables).
        goal: for the state after the command.
    """
    estimate = driver.estimate(reading, last_command)
    plan = driver.plan(estimate, goal)
    return driver.act(plan, estimate)
