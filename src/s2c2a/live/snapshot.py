"""Interface between the page and the control of an arm: snapshots and `Control`.

Light to import, as the process of the page needs neither planner nor robot.
"""

import math
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing.process import BaseProcess
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.live.request import Point, Request, RequestLimits, point
from s2c2a.runtime import StepRecord
from s2c2a.spaces import POSITION, Stage, States

PATIENCE = 5.0  # s; time limit of each step of a shutdown


@dataclass(frozen=True)
class Snapshot:
    """State of the arm and its control after one control step; do not modify arrays.

    Attributes:
        step: record of the control loop.
        stage: stage of the control loop.
        states: of the arm, shape (modules, 6), base frame; the model's prediction if no
            sensor measures states.
        predicted: states that the plan leads to, shape (modules, 6), base frame.
        predictive_std: predictive standard deviation of the tip's position [m].
        error: distance of the tip from its desired position [m]; NaN without one.
        clearance: distance of the tip from the nearest threshold [m]; infinite without
            obstacles.
        task_step: current step of the task.
        task_steps: number of steps of the task; zero without a task.
        strategy: name of the strategy.
        fault: description of the fault, or empty.
        ignored: what the goal has and the strategy ignores, or empty.
    """

    step: StepRecord
    stage: Stage
    states: States
    predicted: States
    predictive_std: float
    error: float
    clearance: float
    task_step: int
    task_steps: int
    strategy: str
    fault: str = ""
    ignored: str = ""

    @property
    def tip(self) -> Point:
        """Position of the tip [m], base frame."""
        return point(self.states[-1, POSITION])

    @property
    def finished(self) -> bool:
        """Whether the task is at its last step."""
        return 0 < self.task_steps <= self.task_step + 1


class Control(ABC):
    """Moves the arm according to the latest request, in this or another process.

    Attributes:
        arm: the arm.
        limits: limits of requests.
        strategies: names of the available strategies.
        request: the latest request.
        halted_by: reason of the last stop.
    """

    arm: ArmSpec
    limits: RequestLimits
    strategies: tuple[str, ...] = ()
    halted_by: str = ""

    def __init__(self) -> None:
        """Start with an empty request and without a snapshot."""
        self._lock = threading.RLock()
        self.request = Request()
        self._watchers: list[Callable[[Snapshot], None]] = []
        self._latest: Snapshot | None = None

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, or None before the first."""
        return self._latest

    def ask(self, **changes: Any) -> Request:
        """Change the request within its limits and return it; from any thread."""
        with self._lock:
            self.request = self.limits.changed(self.request, **changes)
            return self.request

    def halt(self, by: str) -> None:
        """Request a stop, which lasts until `ask(stopped=False)`.

        The control obeys in its next step, if it responds.

        Args:
            by: reason, for `halted_by`.
        """
        with self._lock:
            self.halted_by = by
            self.ask(stopped=True)

    def reset(self) -> None:
        """Reopen the robot at rest; moves the target there and ends the task.

        Raises:
            S2C2AError: the control does not respond.
        """
        with self._lock:
            target = point(straight(self.arm)[-1, POSITION])
            self.ask(target=target, axis=None, shape=None, task=None, playing=False)
            self.order("reopen")

    def step_task(self) -> None:
        """Advance a paused task by one step."""
        self.order("advance", 1.0)

    def restart_task(self) -> None:
        """Return to the first step of the task."""
        self.order("advance", -math.inf)

    def watch(self, watcher: Callable[[Snapshot], None]) -> Callable[[], None]:
        """Call a fast function with every snapshot; returns a function that ends it."""
        self._watchers.append(watcher)
        return partial(self._watchers.remove, watcher)

    @property
    @abstractmethod
    def responds(self) -> bool:
        """Whether the control runs and responds."""

    @abstractmethod
    def order(self, name: str, *arguments: Any) -> None:
        """Queue `reopen`, or `advance` with a number of task steps."""

    @abstractmethod
    def use(self, name: str) -> None:
        """Change the strategy; the arm first returns to rest, where strategies start.

        Raises:
            S2C2AError: no such strategy, or it cannot be built.
        """

    @abstractmethod
    def stop(self) -> None:
        """Return the arm to rest, close it and end the control."""

    def wait_for_rest(self, worker: threading.Thread | BaseProcess) -> None:
        """Wait until the control's worker ends, as long as new snapshots arrive."""
        last: object = self
        while worker.is_alive() and self._latest is not last:
            last = self._latest
            worker.join(PATIENCE)

    def _show(self, snapshot: Snapshot) -> None:
        self._latest = snapshot
        for watcher in tuple(self._watchers):
            watcher(snapshot)


def straight(arm: ArmSpec) -> States:
    """States of the straight arm [m], base frame, shape (modules, 6)."""
    states = np.zeros((arm.module_count, 6))
    states[:, 2] = np.cumsum([module.length for module in arm.modules])
    states[:, 5] = 1.0
    return states
