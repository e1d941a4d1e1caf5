"""Control thread of the live page: runs the control loop on the latest request.

The thread never waits for the page: each step reads the latest request and publishes a
frozen snapshot. `s2c2a live` runs the thread in a separate process (`ControlProcess`).
"""

import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError, StrategyError, no_such
from s2c2a.goals import Goal
from s2c2a.live.goals import Disturbable, RequestedDisturbances, goal_of, tip_errors
from s2c2a.live.request import Request, RequestLimits
from s2c2a.live.snapshot import Control, Snapshot, straight
from s2c2a.planning import Guard
from s2c2a.robots import Robot, RobotFactory
from s2c2a.runtime import (
    EMERGENCY_STOP,
    Clock,
    Driver,
    Loop,
    Patience,
    StepRecord,
    StepRequest,
    WallClock,
)
from s2c2a.spaces import POSITION, Stage
from s2c2a.strategies import (
    STRATEGIES,
    RunOptions,
    networks_from,
    recipe_named,
    shipped_networks,
    shown_name,
    strategy_named,
)
from s2c2a.strategies.pcc import PlainPCC
from s2c2a.tasks import TASKS, Task, load_task

Strategies = Mapping[str, Callable[[], Driver]]
Tasks = Mapping[str, Callable[[], Task]]
"""Builders by name; strategies and tasks are built on first use."""
SLOW_TASKS = ("follow",)  # take a second to build, as they solve for reachable points


class ArmControl(Control):
    """Controls an arm in this process, in a separate thread."""

    def __init__(
        self,
        robot: Robot,
        strategies: Strategies,
        tasks: Tasks,
        release_after: float,
        clock: Clock | None = None,
    ):
        """Build the control loop without opening the robot.

        Args:
            robot: opened and closed by the control thread.
            strategies: builders of strategies for this arm by name; the first strategy
                is built now, the others on first use.
            tasks: builders of tasks by name; a task is built when first played.
            release_after: time without a driver [s] after which the arm returns to
                rest.
            clock: of the control loop; by default the wall clock.

        Raises:
            S2C2AError: the strategy cannot be built, or needs a sensor that the robot
                does not provide.
        """
        super().__init__()
        self.arm = robot.arm
        self.strategies = tuple(strategies)
        self.limits = RequestLimits.of(
            robot.arm, tuple(tasks), isinstance(robot, Disturbable)
        )
        self._builders = strategies
        self._name = self.strategies[0]
        self._tasks = tasks
        self._disturbances = RequestedDisturbances(robot)
        patience = Patience.of(robot.arm.control_rate, alone=release_after)
        strategy = strategies[self._name]()
        sensing = self._disturbances.corrupt
        self._clock = clock or WallClock()
        self._loop = Loop(
            robot, strategy, self._clock, patience=patience, sensing=sensing
        )
        self._commands: deque[Callable[[], None]] = deque()
        self._stopping = threading.Event()
        self._opened = threading.Event()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._task_name: str | None = None
        self._task_position = 0.0
        self._last_goal = self._no_goal = Goal.of(self.arm.module_count)
        self._requested_goal = self._no_goal
        self._predicted = straight(robot.arm)

    @property
    def responds(self) -> bool:
        return self._thread.is_alive()

    @property
    def standstill(self) -> str:
        """How long this process stood still, until a driver resumes; or nothing."""
        return self._loop.standstill

    def ask(self, **changes: Any) -> Request:
        """See `Control`; `stopped=False` also resumes after a standstill."""
        with self._lock:
            resumes = self.request.stopped and changes.get("stopped") is False
            if resumes and self._loop.standstill:
                self._commands.append(self._loop.resume)
            return super().ask(**changes)

    def order(self, name: str, *arguments: Any) -> None:
        self._commands.append(partial(getattr(self, f"_{name}"), *arguments))

    def use(self, name: str) -> None:
        """See `Control`; builds the strategy in the calling thread."""
        if name not in self._builders:
            raise S2C2AError(no_such("strategy", name, self.strategies))
        strategy = self._builders[name]()
        self._loop.required_sensors(
            strategy
        )  # raises here, while the arm keeps running
        self._loop.prepare(strategy)
        self._commands.append(partial(self._change_strategy, strategy, name))

    def prepare(self) -> None:
        """Build every task in the calling thread."""
        for build in self._tasks.values():
            build()

    def start(self) -> None:
        """Open the robot and start the control loop; the first step may compile.

        Raises:
            S2C2AError: the robot did not open.
        """
        self._thread.start()
        while not self._opened.wait(1.0):  # Ctrl-C ends no longer wait on Windows
            pass
        if self._loop.phase.stage is Stage.FAULT:
            raise S2C2AError(f"the arm did not open: {self._loop.fault}")

    def stop(self) -> None:
        """See `Control`; does not wait for a loop that no longer makes progress."""
        self._stopping.set()
        self.wait_for_rest(self._thread)

    def _run(self) -> None:
        try:
            with self._loop:
                self._tick()
                self._opened.set()
                while not self._stopping.is_set():
                    self._tick()
                for step in self._loop.to_rest():
                    self._publish(step)
        except Exception as error:  # `start` raises it, or the page shows it
            self._loop.stop(error)
        self._opened.set()

    def _tick(self) -> None:
        """Run one control step.

        An error of the robot or strategy stops the arm but not this thread, so that the
        driver can reset the arm.
        """
        try:
            while self._commands:
                self._commands.popleft()()
            standstill = self._loop.standstill
            request = self.request
            self._disturbances.apply(request)
            self._requested_goal = self._goal(request)
            ask = StepRequest(
                self._requested_goal,
                request.driven and not request.stopped,
                request.driven,
            )
            self._publish(self._loop.tick(ask))
            if not standstill and self._loop.standstill:
                self.halt(self._loop.standstill)
        except Exception as error:
            if not self._opened.is_set():
                raise
            self._loop.stop(error)
            self._clock.wait_until(self._clock.now() + self.arm.control_period)
            if self._latest is not None:
                self._show(
                    replace(self._latest, stage=Stage.FAULT, fault=self._loop.fault)
                )

    def _reopen(self) -> None:
        """Open the robot again at rest and rewind the task."""
        EMERGENCY_STOP.reset()
        self._loop.open()
        self._disturbances.begin()
        self._task_name = None
        self._task_position = 0.0

    def _change_strategy(self, strategy: Driver, name: str) -> None:
        self._loop.use(strategy)
        self._loop.release()
        self._name = name

    @property
    def _task(self) -> Task | None:
        return self._tasks[self._task_name]() if self._task_name else None

    def _goal(self, request: Request) -> Goal:
        """Goal of this control step; advances the task that plays."""
        if request.task != self._task_name:
            self._task_name = request.task
            self._task_position = 0.0
        task = self._task
        goal = goal_of(
            request,
            self.arm.module_count,
            task.goals[int(self._task_position)] if task else None,
        )
        if (
            request.playing
            and self._loop.phase.stage is Stage.RUN
            and not request.stopped
        ):
            self._advance(request.speed)
        return goal

    def _advance(self, steps: float) -> None:
        if task := self._task:
            self._task_position = float(
                np.clip(self._task_position + steps, 0, len(task.goals) - 1)
            )

    def _goal_after(self, step: StepRecord) -> Goal:
        """Goal that judges the next reading; a held arm misses what is requested."""
        if step.stage is Stage.RUN and step.goal is not None:
            return step.goal
        return self._requested_goal if step.stage is Stage.HOLD else self._no_goal

    def _publish(self, step: StepRecord) -> None:
        """Publish this step's reading, judged by the goal of the last step."""
        states = step.reading.sensors.get("states", self._predicted)
        # the loop does not check sensors that the strategy does not need
        if np.shape(states) != self._predicted.shape:
            states = self._predicted
        active = step.stage in (Stage.RUN, Stage.HOLD)
        goal = self._last_goal if active else self._no_goal
        error, clearance = tip_errors(
            goal, states[-1, POSITION], self.arm.modules[-1].radius
        )
        self._last_goal = self._goal_after(step)
        self._predicted = step.diagnostics.get(
            "predicted", self._predicted if step.diagnostics else states
        )
        predictive_std = float(
            np.ravel(step.diagnostics.get("predictive_std", np.nan))[-1]
        )
        task = self._task
        self._show(
            Snapshot(
                step=step,
                stage=step.stage,
                states=np.array(states),
                predicted=np.array(self._predicted),
                predictive_std=predictive_std,
                error=error,
                clearance=clearance,
                task_step=int(self._task_position),
                task_steps=len(task.goals) if task else 0,
                strategy=self._name,
                fault=step.fault,
                ignored=self._ignored(step.goal),
            )
        )

    def _ignored(self, goal: Goal | None) -> str:
        """Parts of a goal that the strategy ignores; empty if none."""
        stated = getattr(self._loop.driver, "ignores", ())
        return ", ".join(sorted(goal.parts.intersection(stated))) if goal else ""


def arm_control(
    arm: ArmSpec,
    robot: RobotFactory,
    weights: tuple[str, ...] = (),
    guard: Guard = "tip",
    seed: int = 0,
    release_after: float = 10.0,
    strategies: tuple[str, ...] = (),
) -> ArmControl:
    """Control of an arm that is not started yet; see `s2c2a live` for the options.

    Raises:
        S2C2AError: a strategy file cannot be read, or an option does not fit the arm.
    """
    return ArmControl(
        robot.make(arm, seed=seed),
        strategies_of(arm, weights, guard, strategies),
        tasks_of(arm),
        release_after,
    )


def tasks_of(arm: ArmSpec) -> Tasks:
    """Tasks that fit an arm, by name; slow ones are built on first use."""
    tasks: dict[str, Callable[[], Task]] = {}
    for name in TASKS:
        build = cache(partial(load_task, name, arm=arm))
        with suppress(S2C2AError):  # an arm of one module has no middle to hold
            if name not in SLOW_TASKS:
                build()
            tasks[name] = build
    return tasks


def strategies_of(
    arm: ArmSpec,
    files: tuple[str, ...],
    guard: Guard,
    names: tuple[str, ...] = (),
) -> Strategies:
    """Strategies that can drive an arm, by name, built when first used.

    Weight files come first, else the networks of the package; then strategies by name,
    and PCC, which needs no networks.

    Args:
        arm: that is driven.
        files: of weights; "shipped" stands for those of the package.
        guard: which points are kept out of obstacles.
        names: of strategies without training (`strategy_named`).

    Raises:
        StrategyError: a file cannot be read, or a strategy needs training or does not
            support the guard.
    """
    networks = [networks_from(file, arm) for file in files]
    labels = [Path(file).stem for file in files]
    if not networks:
        with suppress(StrategyError):
            networks = [shipped_networks(arm)]
            labels = ["best"]
    run = RunOptions(guard)
    builders: dict[str, Callable[[], Driver]] = {}
    for label, trained in zip(labels, networks, strict=True):
        options = STRATEGIES.imported(trained.strategy)(**trained.strategy_options)
        run.check_supported(options.supports, f"strategy '{trained.strategy}'")
        build = partial(options.driver, arm, trained.recipe, trained, run)
        builders[f"{options.name} · {label}"] = cache(build)
    for name in names:
        options = strategy_named(name)
        run.check_supported(options.supports, f"strategy '{name}'")
        recipe = recipe_named("best")
        if options.collect_options(recipe, 0) is not None:
            raise StrategyError(
                f"strategy '{name}' needs training; train it with `s2c2a train "
                f"--strategy {name}` and give the file with --weights"
            )
        build = partial(options.driver, arm, recipe, None, run)
        builders[shown_name(name)] = cache(build)
    for name in ("best", "paper"):
        build_pcc = partial(PlainPCC().build, arm, recipe_named(name), None, run)
        builders[f"pcc · {name}"] = cache(build_pcc)
    return builders
