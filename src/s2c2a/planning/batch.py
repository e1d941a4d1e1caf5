"""Planning for many at once, offline: many goals, many starts, whole paths. The control step is the planner's.

Work goes in chunks of one size, padded, over threads: nothing compiles anew for another
number, and results do not depend on the number of threads.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import TargetError
from s2c2a.executors import all_cores
from s2c2a.goals import Goal
from s2c2a.kinematics import ForwardModel
from s2c2a.planning.planner import PAPER, Plan, PlannerOptions, Step
from s2c2a.planning.terms import Numbers
from s2c2a.compilation import compiled

CHUNK = 64


class PlannedPath(NamedTuple):
    """A planned path.

    Attributes:
        configurations: of every step, shape (steps, modules, 3), module frames.
        states: that the forward model predicts [m, 1], shape (steps, modules, 6), base
            frame.
    """

    configurations: Float[Numbers, "steps modules 3"]
    states: Float[Numbers, "steps modules 6"]


class Best(NamedTuple):
    """The best of many ways to a goal.

    Attributes:
        configurations: where it ends, shape (modules, 3), module frames.
        value: of the objective there (Chen et al. 2025, eq. (7)).
        start: number of the start that it began from.
        values: of the objective where every start has led to, shape (starts,).
    """

    configurations: Float[np.ndarray, "modules 3"]
    value: float
    start: int
    values: Float[np.ndarray, " starts"]


class BatchPlanner:
    """Plans for many at once; a program compiles when first needed, for any number after it.

    What follows a plan is taken to be what was planned, so paths are those of an arm
    whose controller misses nothing.
    """

    def __init__(
        self,
        arm: ArmSpec,
        model: ForwardModel,
        options: PlannerOptions,
        chunk: int = CHUNK,
        threads: int | None = None,
    ):
        """Prepare for an arm and a forward model; nothing compiles yet.

        Args:
            arm: its limits count.
            model: predicts states.
            options: how to plan.
            chunk: plans in one call; larger ones suit a GPU.
            threads: chunks side by side; all cores if not stated.

        Raises:
            TargetError: a chunk or a number of threads below one.
        """
        if chunk < 1 or (threads is not None and threads < 1):
            raise TargetError(
                f"chunks of {chunk} on {threads} threads asked for; both must be at least one"
            )
        self._chunk = chunk
        self._threads = threads or all_cores()
        step = Step.of(arm, model, options)
        self._start = compiled(_each, Step.started, step)
        self._free = compiled(_each, Step.next_plan, step)
        self._alone = compiled(_alone, step)
        self._along = compiled(_along, step)
        self._values = compiled(
            _each, _value, Step.of(arm, model, replace(PAPER, guard=options.guard))
        )

    def start(self, sensed: Float[Numbers, "batch modules 3"]) -> Plan:
        """Plans of arms at rest; arrays of the plan have the batch in front.

        Raises:
            TargetError: no arm, or configurations that are not finite.
        """
        configurations = np.asarray(sensed, np.float32)
        if not len(configurations) or not np.isfinite(configurations).all():
            raise TargetError(
                f"configurations of shape {configurations.shape} given; give at least one, all finite"
            )
        return self._in_chunks(self._start, self._chunk, configurations)

    def plan(
        self, plans: Plan, sensed: Float[Numbers, "batch modules 3"], goals: Goal
    ) -> Plan:
        """The next plan of each, towards goals of their own (`Goal.stacked`).

        Args:
            plans: the last ones.
            sensed: the latest sensed configurations.
            goals: with the batch in front.

        Raises:
            TargetError: not as many goals as plans.
        """
        count = len(plans.configurations)
        arms = len(sensed)
        asked = len(goals.positions)
        if not count == arms == asked:
            raise TargetError(
                f"{count} plans, {arms} sensed arms and {asked} goals; give as many"
            )
        inputs = plans, np.asarray(sensed, np.float32)
        # side by side, ways round would be searched for all
        if (np.asarray(goals.thresholds) > 0).any():
            return self._in_chunks(self._alone, 1, *inputs, goals)
        # no work for none
        free = goals._replace(
            obstacles=goals.obstacles[:, :0], thresholds=goals.thresholds[:, :0]
        )
        return self._in_chunks(self._free, self._chunk, *inputs, free)

    def best(
        self, starts: Float[Numbers, "starts modules 3"], goal: Goal, steps: int = 50
    ) -> Best:
        """From many starts towards one goal, and the best end of all: what a single start stays short of.

        Args:
            starts: configurations to begin from.
            goal: for the end.
            steps: control steps that each may take.

        Raises:
            TargetError: no start, one that is not finite, or no step.
        """
        if steps < 1:
            raise TargetError(f"{steps} steps asked for; take at least one")
        plans = self.start(starts)
        goals = Goal.stacked([goal] * len(starts))
        for _ in range(steps):
            plans = self.plan(plans, plans.configurations, goals)
        values = self._in_chunks(self._values, self._chunk, plans, goals)
        first = int(np.argmin(values))
        return Best(
            np.asarray(plans.configurations[first]), float(values[first]), first, values
        )

    def path(self, start: Float[Numbers, "modules 3"], goals: Goal) -> PlannedPath:
        """A whole path from an arm at rest.

        Args:
            start: where it rests.
            goals: one a step (`Goal.stacked`).

        Raises:
            TargetError: no goal, or a start that is not finite.
        """
        if not len(goals.positions):
            raise TargetError("a path of no steps asked for; give at least one goal")
        count = len(goals.positions)
        plan = jax.tree.map(lambda part: part[0], self.start(np.asarray(start)[None]))
        parts = []
        for begin in range(0, count, self._chunk):
            plan, part = self._along(plan, _cut(goals, begin, self._chunk))
            parts.append(part)
        return PlannedPath(
            *(np.concatenate(arrays)[:count] for arrays in zip(*parts, strict=True))
        )

    def _in_chunks(self, program: Callable[..., Any], size: int, *inputs: Any) -> Any:
        """A program over all chunks, on threads, its results put together again."""
        inputs = jax.tree.map(np.asarray, inputs)
        count = len(jax.tree.leaves(inputs)[0])

        def one(begin: int):
            return jax.tree.map(np.asarray, program(*_cut(inputs, begin, size)))

        with ThreadPoolExecutor(self._threads) as pool:
            results = list(pool.map(one, range(0, count, size)))
        return jax.tree.map(lambda *arrays: np.concatenate(arrays)[:count], *results)


def _cut(inputs: Any, begin: int, size: int) -> Any:
    """One chunk; the last one filled up with its last row."""
    last = len(jax.tree.leaves(inputs)[0]) - 1
    rows = np.minimum(np.arange(begin, begin + size), last)
    return jax.tree.map(lambda values: np.asarray(values)[rows], inputs)


def _each(work: Callable[..., Any], step: Step, *inputs: Any) -> Any:
    return jax.vmap(partial(work, step))(*inputs)


def _alone(step: Step, plans: Plan, sensed, goals: Goal) -> Plan:
    """A chunk of one, so that ways round are searched only where they are needed."""
    plan = step.next_plan(
        *jax.tree.map(lambda values: values[0], (plans, sensed, goals))
    )
    return jax.tree.map(lambda values: values[None], plan)


def _along(step: Step, plan: Plan, goals: Goal) -> tuple[Plan, PlannedPath]:
    def on(last: Plan, goal: Goal) -> tuple[Plan, PlannedPath]:
        plan = step.next_plan(last, last.configurations, goal)
        return plan, PlannedPath(plan.configurations, step.expectation(plan).states)

    return jax.lax.scan(on, plan, goals)


def _value(paper: Step, plan: Plan, goal: Goal):
    return paper.problem(plan.configurations, plan.memory, goal).sum_of_norms(
        plan.configurations
    )
