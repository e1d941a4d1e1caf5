"""The arm under a driver's hand: the runtime's loop, in a thread of its own, fed with the latest request.

It never waits for the page: it reads the latest request and leaves a frozen snapshot
behind. The live page has it in a process of its own besides (`ControlProcess`).
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
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.goals import Goal
from s2c2a.live.goals import Disturbable, Disturbances, goal_of, judged
from s2c2a.live.request import Request, RequestLimits
from s2c2a.live.snapshot import Control, Snapshot, straight
from s2c2a.models.registry import model_named
from s2c2a.planning import Guard
from s2c2a.compilation import compilations
from s2c2a.robots import Body, Robot
from s2c2a.runtime import Ask, Loop, Patience, Step, WallClock
from s2c2a.spaces import POSITION, Stage
from s2c2a.strategies import (
    AnyStrategy,
    Strategy,
    load_strategy,
    pcc_strategy,
    recipe_named,
    s2c2a_strategy,
    shipped_networks,
)
from s2c2a.tasks import TASKS, Task, task_named

Strategies = Mapping[str, Callable[[], AnyStrategy]]
Tasks = Mapping[str, Callable[[], Task]]
"""By name, and made when first asked for, as strategies are."""
# a task that takes a second to make: it solves for what is within reach
LATER = ("follow",)


class ArmControl(Control):
    """Moves an arm in this process, in a thread of its own."""

    def __init__(
        self, robot: Robot, strategies: Strategies, tasks: Tasks, release_after: float
    ):
        """Nothing is opened yet.

        Args:
            robot: the body; it is opened and closed by the thread.
            strategies: what can drive its arm, by name; the first one is built now,
                another when it is used.
            tasks: what can be played, by name; made when first played.
            release_after: seconds without a driver until the cables are led back to
                rest.

        Raises:
            S2C2AError: the strategy cannot be built, or needs what the body does not
                say.
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
        self._disturbances = Disturbances(robot)
        patience = Patience.of(robot.arm.control_rate, alone=release_after)
        driver = strategies[self._name]()
        faults = self._disturbances.spoilt
        self._margins = _margins_of(driver)
        self._loop = Loop(robot, driver, WallClock(), patience=patience, faults=faults)
        self._orders: deque[Callable[[], None]] = deque()
        self._stopping = threading.Event()
        self._opened = threading.Event()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._played: str | None = None
        self._place = 0.0
        self._before = self._nothing = Goal.of(self.arm.module_count)
        self._expected = straight(robot.arm)

    @property
    def answers(self) -> bool:
        """See `Control`."""
        return self._thread.is_alive()

    def order(self, name: str, *arguments: Any) -> None:
        """See `Control`."""
        self._orders.append(partial(getattr(self, f"_{name}"), *arguments))

    def use(self, name: str) -> None:
        """See `Control`; it is built at once, in the thread of whoever asks."""
        if name not in self._builders:
            raise S2C2AError(
                f"no strategy '{name}'; choose one of {', '.join(self.strategies)}"
            )
        strategy = self._builders[name]()
        self._loop.needed_by(strategy)  # refused here, and the arm goes on
        self._orders.append(
            partial(self._change_strategy, strategy, name, _margins_of(strategy))
        )

    def prepare(self) -> None:
        """Make every task; in the thread of whoever asks."""
        for make in self._tasks.values():
            make()

    def start(self, timeout: float = 60.0) -> None:
        """Open the robot and begin.

        Raises:
            S2C2AError: the robot did not open.
        """
        self._thread.start()
        if not self._opened.wait(timeout) or self._loop.phase.stage is Stage.FAULT:
            raise S2C2AError(
                f"the arm did not open: {self._loop.fault or f'nothing within {timeout:g} s'}"
            )

    def stop(self) -> None:
        """See `Control`; one that does nothing any more on its way is left."""
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
        except Exception as error:  # told by `start`, or on the page
            self._loop.stop(error)
        self._opened.set()

    def _tick(self) -> None:
        """One control step; a body or strategy that fails stops the arm, not the thread: somebody can reset."""
        try:
            while self._orders:
                self._orders.popleft()()
            request = self.request
            self._disturbances.apply(request)
            ask = Ask(
                self._goal(request),
                request.driven and not request.stopped,
                request.driven,
            )
            self._publish(self._loop.tick(ask))
        except Exception as error:
            if not self._opened.is_set():
                raise
            self._loop.stop(error)
            self._stopping.wait(self.arm.control_period)
            if self._latest is not None:
                self._show(
                    replace(self._latest, stage=Stage.FAULT, fault=self._loop.fault)
                )

    def _begin(self) -> None:
        """The arm at rest, the task at its start."""
        self._loop.open()
        self._disturbances.begin()
        self._played = None
        self._place = 0.0

    def _change_strategy(self, strategy: AnyStrategy, name: str, margins: str) -> None:
        self._loop.use(strategy)
        self._loop.release()
        self._name = name
        self._margins = margins

    @property
    def _task(self) -> Task | None:
        return self._tasks[self._played]() if self._played else None

    def _goal(self, request: Request) -> Goal:
        """What is asked in this step."""
        if request.task != self._played:
            self._played = request.task
            self._place = 0.0
        task = self._task
        goal = goal_of(
            request,
            self.arm.module_count,
            task.goals[int(self._place)] if task else None,
        )
        if (
            request.playing
            and self._loop.phase.stage is Stage.RUN
            and not request.stopped
        ):
            self._move_on(request.speed)
        return goal

    def _move_on(self, steps: float) -> None:
        if task := self._task:
            self._place = float(np.clip(self._place + steps, 0, len(task.goals) - 1))

    def _publish(self, step: Step) -> None:
        """Show what came of the last step: this one's reading, beside what the last one was to lead to."""
        states = step.reading.sensors.get("states", self._expected)
        # nobody has checked what nobody needs
        if np.shape(states) != self._expected.shape:
            states = self._expected
        aimed = self._before if step.stage in (Stage.RUN, Stage.HOLD) else self._nothing
        error, clearance = judged(aimed, states[-1, POSITION])
        self._before = (
            step.goal
            if step.stage is Stage.RUN and step.goal is not None
            else self._nothing
        )
        self._expected = step.diagnostics.get(
            "predicted", self._expected if step.diagnostics else states
        )
        deviation = float(np.ravel(step.diagnostics.get("predictive_std", np.nan))[-1])
        where = (
            np.array(states),
            np.array(self._expected),
            deviation,
            error,
            clearance,
        )
        of_task = (int(self._place), len(self._task.goals) if self._task else 0)
        self._show(
            Snapshot(
                step,
                step.stage,
                *where,
                *of_task,
                self._name,
                compilations(),
                step.fault,
                self._margins,
            )
        )


def _margins_of(strategy: AnyStrategy) -> str:
    """In words; nothing of what closes no loop."""
    margins = strategy.margins if isinstance(strategy, Strategy) else None
    return "" if margins is None else str(margins)


def arm_control(
    arm: ArmSpec,
    body: Body,
    weights: tuple[str, ...] = (),
    guard: Guard = "tip",
    seed: int = 0,
    release_after: float = 10.0,
    model: str | None = None,
) -> ArmControl:
    """A control that is not started yet; options as of `s2c2a live`, where a file of weights may name the model.

    Raises:
        S2C2AError: no networks for this arm, or an option that it cannot have.
    """
    if model:
        model_named(model)
    return ArmControl(
        body.make(arm, seed=seed),
        strategies_of(arm, weights, guard),
        tasks_of(arm),
        release_after,
    )


def tasks_of(arm: ArmSpec) -> Tasks:
    """All tasks that an arm can have, by name; those that are quick are made now, the others when first asked for."""
    tasks: dict[str, Callable[[], Task]] = {}
    for name in TASKS:
        make = cache(partial(task_named, name, arm=arm))
        with suppress(S2C2AError):  # an arm of one module has no middle to hold
            if name not in LATER:
                make()
            tasks[name] = make
    return tasks


def strategies_of(arm: ArmSpec, files: tuple[str, ...], guard: Guard) -> Strategies:
    """What can drive an arm, by name, built when first asked for; files come first, else what comes with the package.

    For an arm of the user's own no networks come with the package, and `pcc` needs
    none.

    Raises:
        StrategyError: a file cannot be read.
    """
    networks = {
        f"s2c2a · {Path(file).stem}": load_strategy(file, arm) for file in files
    }
    with suppress(StrategyError):
        networks = networks or {"s2c2a · best": shipped_networks(arm)}
    planners = {
        name: replace(recipe_named(name).planner, guard=guard)
        for name in ("best", "paper")
    }
    s2c2a = {
        name: cache(partial(s2c2a_strategy, one, guard))
        for name, one in networks.items()
    }
    return s2c2a | {
        f"pcc · {name}": cache(partial(pcc_strategy, arm, planners[name]))
        for name in planners
    }
