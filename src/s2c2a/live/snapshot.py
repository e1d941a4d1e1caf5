"""What is known after a control step, and what can be asked: all that the page needs of the control loop.

Light to import, for the page's process has neither planner nor body; `Asked` is a `planning.Goal` in plain arrays.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.live.wish import Limits, Wish
from s2c2a.spaces import Actions, Configurations, States


class Asked(NamedTuple):
    """The fields of a `planning.Goal`."""

    positions: Float[np.ndarray, "modules 3"]
    position_weights: Float[np.ndarray, " modules"]
    axes: Float[np.ndarray, "modules 3"]
    axis_weights: Float[np.ndarray, " modules"]
    obstacles: Float[np.ndarray, "obstacles 3"]
    thresholds: Float[np.ndarray, " obstacles"]
    obstacle_weight: Float[np.ndarray, ""]
    change_weight: Float[np.ndarray, ""]


class Stage(Enum):
    """What the loop does."""

    DRIVEN = "driven"
    HOLDING = "holding"
    RETURNING = "going to rest"
    RESTING = "at rest"
    FAILED = "failed"


@dataclass(frozen=True)
class Snapshot:
    """What is known after one control step; all arrays are the reader's to keep and nobody's to change.

    Attributes:
        number: of the step, counted from the start of the loop.
        moment: when it was done, on the loop's clock [s].
        period: of the control steps [s].
        stage: what the loop does.
        states: of the arm, shape (modules, 6), base frame.
        expected: states that the plan leads to, the same shape.
        configurations: of the arm, shape (modules, 3).
        goal: what was asked in this step, as a `planning.Goal` says it.
        actions: as really sent [m or N], shape (modules, cables).
        error: distance of the tip from where it should be [m]; NaN where nothing is asked of it.
        clearance: least distance of the tip from a threshold [m]; infinite without obstacles.
        tick_time: sense, plan and act together [s].
        task_step: step of the task that is played.
        task_steps: how many steps it has; zero without a task.
        strategy: name of what drives the arm.
        compiled: programs that the loop's process has compiled (`programs.compilations`).
        fault: what went wrong, in words, or nothing.
    """

    number: int
    moment: float
    period: float
    stage: Stage
    states: States
    expected: States
    configurations: Configurations
    goal: Asked
    actions: Actions
    error: float
    clearance: float
    tick_time: float
    task_step: int
    task_steps: int
    strategy: str
    compiled: int = 0
    fault: str = ""


class Control(ABC):
    """What moves the arm as the latest wish says, here or in another process.

    Attributes:
        arm: the arm.
        limits: how far wishes may go.
        strategies: names of what can drive the arm.
    """

    arm: ArmSpec
    limits: Limits
    strategies: tuple[str, ...]

    @property
    @abstractmethod
    def wish(self) -> Wish:
        """The latest wish."""

    @property
    @abstractmethod
    def latest(self) -> Snapshot | None:
        """The latest snapshot, None before the first."""

    @abstractmethod
    def ask(self, **changes: Any) -> Wish:
        """Change the wish, within the limits; returns what it has become. From any thread."""

    @abstractmethod
    def reset(self) -> None:
        """Open the robot anew, at rest; wishes that would move it at once are forgotten."""

    @abstractmethod
    def use(self, name: str) -> None:
        """Drive with another strategy from now on; the arm goes to rest first, where strategies begin."""

    @abstractmethod
    def step_task(self) -> None:
        """One step of a task that waits."""

    @abstractmethod
    def restart_task(self) -> None:
        """Back to the task's first step."""

    @abstractmethod
    def watch(self, watcher: Callable[[Snapshot], None]) -> Callable[[], None]:
        """Call a watcher with every snapshot; it must be quick. Returns what ends it."""

    @abstractmethod
    def stop(self) -> None:
        """Lead the arm to rest, close it, and end."""
