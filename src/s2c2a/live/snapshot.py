"""What is known after a control step, and what can be asked: all that the page needs of what moves the arm.

Light to import, for the page's process has neither planner nor body.
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
from s2c2a.live.request import Request, RequestLimits
from s2c2a.runtime import Step
from s2c2a.spaces import Stage, States

PATIENCE = 5.0  # s for what is left to do in the end


@dataclass(frozen=True)
class Snapshot:
    """What is known after one control step; all arrays are the reader's to keep and nobody's to change.

    Attributes:
        step: of the control loop.
        stage: what the arm does.
        states: of the arm, shape (modules, 6), base frame; what its model expects where
            nothing watches it.
        expected: states that the plan leads to, the same shape.
        deviation: how far off the tip must be expected to be there [m].
        error: distance of the tip from where it should be by now [m]; NaN where nothing
            is asked of it.
        clearance: least distance of the tip from a threshold [m]; infinite without
            obstacles.
        task_step: step of the task that is played.
        task_steps: how many steps it has; zero without a task.
        strategy: name of what drives the arm.
        compiled: programs that the process has compiled (`programs.compilations`).
        fault: what is wrong, in words, or nothing.
        margins: of the loop that the strategy closes, in words, or nothing.
    """

    step: Step
    stage: Stage
    states: States
    expected: States
    deviation: float
    error: float
    clearance: float
    task_step: int
    task_steps: int
    strategy: str
    compiled: int = 0
    fault: str = ""
    margins: str = ""

    @property
    def finished(self) -> bool:
        """Whether the task that is played is at its last step."""
        return 0 < self.task_steps <= self.task_step + 1


class Control(ABC):
    """What moves the arm as the latest request says, here or in another process.

    Attributes:
        arm: the arm.
        limits: how far requests may go.
        strategies: names of what can drive the arm.
        request: the latest one.
        halted_by: who or what stopped the arm last, in words.
    """

    arm: ArmSpec
    limits: RequestLimits
    strategies: tuple[str, ...] = ()
    halted_by: str = ""

    def __init__(self) -> None:
        """Nothing asked, nothing known, nobody watching."""
        self._lock = threading.RLock()
        self.request = Request()
        self._watchers: list[Callable[[Snapshot], None]] = []
        self._latest: Snapshot | None = None

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, None before the first."""
        return self._latest

    def ask(self, **changes: Any) -> Request:
        """Change the request, within the limits; returns what it has become. From any thread."""
        with self._lock:
            self.request = self.limits.changed(self.request, **changes)
            return self.request

    def halt(self, by: str) -> bool:
        """Stop the arm until somebody asks with `stopped=False`; returns whether what moves it can hear that now."""
        with self._lock:
            self.halted_by = by
            self.ask(stopped=True)
        return self.answers

    def reset(self) -> None:
        """Open the robot anew, at rest; requests that would move it at once are forgotten.

        Raises:
            S2C2AError: there is nobody any more who could.
        """
        with self._lock:
            self.ask(target=None, axis=None, task=None, playing=False)
            self.order("begin")

    def step_task(self) -> None:
        """One step of a task that waits."""
        self.order("move_on", 1.0)

    def restart_task(self) -> None:
        """Back to the task's first step."""
        self.order("move_on", -math.inf)

    def watch(self, watcher: Callable[[Snapshot], None]) -> Callable[[], None]:
        """Call a watcher with every snapshot; it must be quick. Returns what ends it."""
        self._watchers.append(watcher)
        return partial(self._watchers.remove, watcher)

    @property
    @abstractmethod
    def answers(self) -> bool:
        """Whether what moves the arm is there, and goes on."""

    @abstractmethod
    def order(self, name: str, *arguments: Any) -> None:
        """Have the arm `begin` anew, or its task `move_on` by so many steps, before the next control step."""

    @abstractmethod
    def use(self, name: str) -> None:
        """Drive with another strategy from now on; the arm goes to rest first, where strategies begin.

        Raises:
            S2C2AError: no such strategy, or it cannot be built.
        """

    @abstractmethod
    def stop(self) -> None:
        """Lead the arm to rest, close it, and end."""

    def wait_for_rest(self, mover: threading.Thread | BaseProcess) -> None:
        """Wait until what moves the arm ends, as long as it goes on: an arm is led to rest in its own time."""
        before: object = self
        while mover.is_alive() and self._latest is not before:
            before = self._latest
            mover.join(PATIENCE)

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
