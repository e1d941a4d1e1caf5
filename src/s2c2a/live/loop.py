"""The control loop: in a thread of its own, at the control rate, whatever the browsers do.

It never waits for the scene: it reads the latest wish and leaves a frozen snapshot behind. The live page has it in a
process of its own besides (`ControlProcess`).
"""

import queue
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.live.asking import goal_of, judged
from s2c2a.live.clock import Clock, WallClock
from s2c2a.live.disturbing import Disturbable, SensorFaults
from s2c2a.live.snapshot import Asked, Control, Snapshot, Stage
from s2c2a.live.watchers import Watchers
from s2c2a.live.wish import Limits, Wish
from s2c2a.planning import Goal
from s2c2a.programs import compilations
from s2c2a.robots import Robot
from s2c2a.spaces import POSITION, Actions, Reading
from s2c2a.strategies import Strategy
from s2c2a.tasks import Task

RELEASE_AFTER = 10.0  # s without a driver until the cables are led back to rest
NO_PUSH = (0.0, 0.0, 0.0)


class ControlLoop(Control):
    """A control loop in this process, in a thread of its own."""

    def __init__(
        self,
        robot: Robot,
        strategies: Mapping[str, Callable[[], Strategy]],
        tasks: Mapping[str, Task],
        disturbable: Disturbable | None = None,
        clock: Clock | None = None,
        release_after: float = RELEASE_AFTER,
    ):
        """A loop that is not started yet.

        Args:
            robot: the body; it is opened and closed by the loop's thread.
            strategies: what can drive its arm, by name; the first one is built now, another when it is used.
            tasks: what can be played, by name.
            disturbable: what pushes and payloads act on, if anything.
            clock: the wall's unless stated.
            release_after: seconds without a driver until the cables are led back to rest.
        """
        self.arm: ArmSpec = robot.arm
        self.strategies = tuple(strategies)
        self.limits = Limits.of(robot.arm, tuple(tasks))
        self._builders, self._name = strategies, self.strategies[0]
        self._robot, self._strategy = robot, strategies[self._name]()
        self._tasks, self._disturbable = tasks, disturbable
        self._clock = clock or WallClock()
        self._release_steps = max(1, round(release_after * robot.arm.control_rate))
        self._faults = SensorFaults(robot.arm)
        self._geometry = ArmGeometry.of(robot.arm)
        self._lock = threading.Lock()
        self._wish, self._latest = Wish(), cast("Snapshot | None", None)
        self._requests: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._stopping, self._opened = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._watchers = Watchers()
        self._stage, self._fault, self._idle, self._number = Stage.RESTING, "", 0, 0
        self._played, self._place, self._payload, self._push = "", 0.0, 0.0, NO_PUSH

    @property
    def wish(self) -> Wish:
        """The latest wish."""
        with self._lock:
            return self._wish

    def ask(self, **changes) -> Wish:
        """Change the wish, within the limits; returns what it has become. From any thread."""
        with self._lock:
            self._wish = self.limits.changed(self._wish, **changes)
            return self._wish

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, None before the first."""
        return self._latest

    def reset(self) -> None:
        """Open the robot anew, at rest; wishes that would move it at once are forgotten."""
        self.ask(target=None, axis=None, task=None, playing=False)
        self._requests.put(self._begin)

    def use(self, name: str) -> None:
        """Drive with another strategy from now on; it is built at once, in the thread of whoever asks.

        Raises:
            S2C2AError: no such strategy, or it cannot be built.
        """
        if name not in self._builders:
            raise S2C2AError(f"no strategy '{name}'; choose one of {', '.join(self.strategies)}")
        self._requests.put(partial(self._change_strategy, self._builders[name](), name))

    def prepare(self) -> None:
        """Look every task up, for those that are made when first looked up; in the thread of whoever asks."""
        for name in self._tasks:
            self._tasks[name]

    def step_task(self) -> None:
        """One step of a task that waits."""
        self._requests.put(partial(self._advance, 1.0))

    def restart_task(self) -> None:
        """Back to the task's first step."""
        self._requests.put(partial(self._advance, -np.inf))

    def watch(self, watcher: Callable[[Snapshot], None]) -> Callable[[], None]:
        """Call a watcher with every snapshot, in the loop's thread: it must be quick. Returns what ends it."""
        return self._watchers.add(watcher)

    def start(self, timeout: float = 60.0) -> None:
        """Open the robot and begin.

        Raises:
            S2C2AError: the robot did not open.
        """
        self._thread.start()
        if not self._opened.wait(timeout) or self._stage is Stage.FAILED:
            raise S2C2AError(f"the arm did not open: {self._fault or f'nothing within {timeout:g} s'}")

    def stop(self, timeout: float = 10.0) -> None:
        """Lead the arm to rest, close it, and end the thread."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(timeout)

    def _run(self) -> None:
        try:
            with self._robot:
                self._begin()
                self._tick()
                self._opened.set()
                self._keep_time()
                self._lead_to_rest()
        except Exception as error:  # told by `start`, or on the page
            self._fail(error)
        self._opened.set()

    def _keep_time(self) -> None:
        """One tick a period; after a stall time is not caught up."""
        period, due = self.arm.control_period, self._clock.now()
        while not self._stopping.is_set():
            due = max(due + period, self._clock.now() - period)
            self._clock.wait_until(due, self._stopping)
            try:
                self._tick()
            except Exception as error:  # of a body or a strategy; the loop must outlive it, so that somebody can reset
                self._fail(error)

    def _lead_to_rest(self) -> None:
        with suppress(S2C2AError):
            while self._stage not in (Stage.RESTING, Stage.FAILED):
                self._return(self._clock.now())

    def _fail(self, error: Exception) -> None:
        """Stand still until somebody resets; what is shown says why."""
        self._stage, self._fault = Stage.FAILED, str(error) or type(error).__name__
        if self._latest is not None:
            self._show(replace(self._latest, stage=self._stage, fault=self._fault, moment=self._clock.now()))

    def _begin(self) -> None:
        """The arm at rest, the strategy at its start."""
        self._reading = self._robot.open()
        self._push = NO_PUSH
        self._strategy.start(self._sensed())
        self._sent = self._geometry.action_neutral.copy()
        self._stage, self._fault, self._played, self._place = Stage.RESTING, "", "", 0.0

    def _change_strategy(self, strategy: Strategy, name: str) -> None:
        self._strategy, self._name = strategy, name
        self._strategy.start(self._sensed())
        self._stage = Stage.RETURNING if self._stage is not Stage.FAILED else Stage.FAILED

    def _tick(self) -> None:
        with suppress(queue.Empty):
            while True:
                self._requests.get_nowait()()
        if self._stage is Stage.FAILED:
            return
        wish, began = self.wish, self._clock.now()
        self._disturb(wish)
        self._stage = self._next_stage(wish)
        if self._stage is Stage.RETURNING:
            self._return(began)
        elif self._stage is Stage.RESTING:
            self._act(self._geometry.action_neutral, Goal.of(self.arm.module_count), began)
        else:
            goal = self._goal(wish)
            self._act(self._strategy.step(self._sensed(), goal), goal, began)

    def _next_stage(self, wish: Wish) -> Stage:
        if self._stage is Stage.RETURNING:
            return Stage.RETURNING
        if wish.driven and not wish.stopped:
            if self._stage is Stage.RESTING:
                self._strategy.start(self._sensed())
            self._idle = 0
            return Stage.DRIVEN
        if self._stage is Stage.RESTING:
            return Stage.RESTING
        self._idle = 0 if wish.driven else self._idle + 1
        return Stage.RETURNING if self._idle > self._release_steps else Stage.HOLDING

    def _goal(self, wish: Wish) -> Goal:
        """What is asked in this step; while holding nothing, so that the plan stays where it is."""
        if self._stage is Stage.HOLDING:
            return Goal.of(self.arm.module_count)
        task = self._task_of(wish)
        if task is None:
            return goal_of(wish, self.arm.module_count, None)
        goal = goal_of(wish, self.arm.module_count, task.goals[int(self._place)])
        if wish.playing:
            self._advance(wish.speed)
        return goal

    def _task_of(self, wish: Wish) -> Task | None:
        asked = wish.task or ""
        if asked != self._played:
            self._played, self._place = asked, 0.0
        return self._tasks[asked] if asked else None

    def _advance(self, steps: float) -> None:
        if self._played:
            self._place = float(np.clip(self._place + steps, 0, len(self._tasks[self._played].goals) - 1))

    def _return(self, began: float) -> None:
        """One step of the cables towards neutral, no faster than the arm's step limit."""
        way = self._sent - self._geometry.action_neutral
        share = np.abs(way / self._geometry.action_scale[:, None]).max()
        limits = np.rad2deg(self._geometry.bend_limits.max())
        left = max(0.0, share - self.arm.step_limit_deg / limits)
        target = self._geometry.action_neutral + way * (left / share if share > 0 else 0.0)
        self._stage = Stage.RETURNING
        self._act(target, Goal.of(self.arm.module_count), began)
        if left == 0.0:
            self._stage = Stage.RESTING

    def _act(self, action: Actions, goal: Goal, began: float) -> None:
        tick_time = self._clock.now() - began
        self._sent = self._robot.send(action)
        self._reading = self._robot.read()
        self._publish(goal, tick_time)

    def _disturb(self, wish: Wish) -> None:
        if self._disturbable is None:
            return
        if wish.payload != self._payload:
            self._disturbable.load(wish.payload)
        if wish.push != self._push:
            self._disturbable.push(np.array(wish.push))
        self._payload, self._push = wish.payload, wish.push

    def _sensed(self) -> Reading:
        return self._faults.applied(self._reading, self.wish.coupling, self.wish.noise)

    def _publish(self, goal: Goal, tick_time: float) -> None:
        expected = self._strategy.expected
        states, configurations = self._reading.states, self._reading.configurations
        if states is None or configurations is None:  # nothing watches the arm: what its model says
            states, configurations = expected, self._strategy.sensed
        error, clearance = judged(goal, states[-1, POSITION])
        self._number += 1
        snapshot = Snapshot(
            number=self._number,
            moment=self._clock.now(),
            period=self.arm.control_period,
            stage=self._stage,
            states=np.array(states),
            expected=expected,
            configurations=np.array(configurations),
            goal=Asked(*map(np.asarray, goal)),
            actions=np.array(self._sent),
            error=error,
            clearance=clearance,
            tick_time=tick_time,
            task_step=int(self._place),
            task_steps=len(self._tasks[self._played].goals) if self._played else 0,
            strategy=self._name,
            compiled=compilations(),
        )
        self._show(snapshot)

    def _show(self, snapshot: Snapshot) -> None:
        self._latest = snapshot
        self._watchers.tell(snapshot)
