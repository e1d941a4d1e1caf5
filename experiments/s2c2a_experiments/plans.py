"""Plans compared with a long multi-start search.

Recorded motions give the cables a history, then each problem has a random goal. A plan
is compared with searches from many starts, first with engaged and then with true
slopes: after one step, within the step limit and with guided goals; and after
`SETTLING` steps, without the step limit and with the desired goals.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.evaluation import Row
from s2c2a.execution.compilation import compiled
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.kinematics.bends import Numbers
from s2c2a.models.forward_model import ForwardModel
from s2c2a.paper import bend_path
from s2c2a.planning import Goal, Plan, PlannerOptions
from s2c2a.planning.planner import Step
from s2c2a.planning.solvers import Problem, Projection, solve_least_squares
from s2c2a.planning.terms import Bends, largest_bend
from s2c2a.strategies import TrainedNetworks

KINDS = ("tip", "tip and axis", "middle and tip", "anywhere")
HISTORY = 40  # steps before the goal
SETTLING = 150  # steps with a constant goal
STARTS = 24  # of the long search
ITERATIONS = 30  # of the long search from each start, with either slopes
OPTIMAL_RATIO = 1.05  # largest ratio of an optimal plan's cost to the long search's
LIMITED = 0.999  # of the step limit; a longer step counts as limited
STUCK_COST = 1.5e-4  # excess cost of a stuck plan; 3 mm at the tip
CHUNK = 250  # problems at once


class PlanningProblems(NamedTuple):
    """Random planning problems.

    Attributes:
        histories: sensed configurations, module frames, shape (problems, steps,
            modules, 3).
        goals: one for each problem.
        starts: of the long search, bends in the unit disc, shape (problems, starts,
            modules, 2).
    """

    histories: Float[Numbers, "problems steps modules 3"]
    goals: Goal
    starts: Float[Numbers, "problems starts modules 2"]


class Comparison(NamedTuple):
    """Costs of plans and of the long search, sums of mu |r|^2.

    Attributes:
        cost: of the plan, shape (problems,).
        least: smallest cost of the long search, shape (problems,).
        limited: whether the step limit is active, shape (problems,).
    """

    cost: Float[Numbers, " problems"]
    least: Float[Numbers, " problems"]
    limited: Bool[Numbers, " problems"]

    @property
    def optimal(self) -> np.ndarray:
        """Whether the cost is within 5 % of the best known, or the step is limited."""
        return np.asarray(self.limited | (self.cost <= OPTIMAL_RATIO * self.least))

    @property
    def stuck(self) -> np.ndarray:
        """Whether the plan is not optimal and its excess cost is above `STUCK_COST`."""
        return ~self.optimal & (np.asarray(self.cost - self.least) > STUCK_COST)


def sample_problems(
    arm: ArmSpec, model: ForwardModel, count: int, seed: int
) -> PlanningProblems:
    """Sample problems, a quarter of each of `KINDS`.

    Args:
        arm: its planning limits count.
        model: predicts the states from which goals are taken.
        count: number of problems.
        seed: of all samples.
    """
    random = np.random.default_rng(seed)
    modules = arm.module_count
    limits = ArmGeometry.of(arm).planned_bends[:, None]
    paths = np.array(
        [[bend_path(HISTORY, random) for _ in range(modules)] for _ in range(count)]
    )
    paths = np.moveaxis(paths, 1, 2)
    histories = configurations_from_bends(jnp.asarray(paths * limits, jnp.float32))
    bends = _sample_discs(random, (count, modules)) * limits
    shapes = configurations_from_bends(jnp.asarray(bends, jnp.float32))
    predict = jax.vmap(lambda shape: model.predict(shape, model.start(shape)))
    goals = []
    for number, states in enumerate(np.asarray(predict(shapes))):
        goals.append(_sample_goal(KINDS[number % 4], states, arm, random))
    goal = Goal.stacked(goals).with_rows(slice(0))
    starts = _sample_discs(random, (count, STARTS, modules)).astype(np.float32)
    return PlanningProblems(np.asarray(histories), goal, starts)


def _sample_discs(random: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Uniform samples in the unit disc, shape (*shape, 2)."""
    angles = random.uniform(0, 2 * np.pi, shape)
    radii = np.sqrt(random.uniform(size=shape))
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return radii[..., None] * directions


def _sample_goal(
    kind: str, states: np.ndarray, arm: ArmSpec, random: np.random.Generator
) -> Goal:
    goal = Goal.of(arm.module_count)
    if kind == "anywhere":
        position = random.uniform([-1.0, -1.0, 0.3], [1.0, 1.0, 1.1])
        return goal.with_position(arm.length * position)
    if kind == "middle and tip":
        middle = (arm.module_count - 1) // 2
        goal = goal.with_position(states[middle, :3], 4.0, module=middle)
    if kind == "tip and axis":
        goal = goal.with_axis(states[-1, 3:])
    return goal.with_position(states[-1, :3])


class _Planners(NamedTuple):
    """One planning step with the options of the planner, and its variants.

    Attributes:
        guided: the planner itself.
        guided_true: with true slopes.
        unguided: without guides.
        unguided_true: without guides, with true slopes.
    """

    guided: Step
    guided_true: Step
    unguided: Step
    unguided_true: Step

    @classmethod
    def of(
        cls, arm: ArmSpec, model: ForwardModel, options: PlannerOptions
    ) -> "_Planners":
        steps = []
        for variant in (options, replace(options, guides=())):
            steps.append(Step.of(arm, model, variant))
            steps.append(Step.of(arm, model, replace(variant, engaged_slopes=False)))
        return cls(*steps)


def _after_one_step(planners: _Planners, problem: PlanningProblems) -> Comparison:
    step = planners.guided

    def observe(memory, configuration):
        return step.model.observe(configuration, memory), None

    plan = step.started(problem.histories[0])
    memory, _ = jax.lax.scan(observe, plan.memory, jnp.asarray(problem.histories))
    last = step.started(problem.histories[-1])._replace(memory=memory)
    plan = step.next_plan(last, last.configurations, problem.goals)
    shared = last._replace(memory=plan.memory)
    engaged = step.problem(shared, problem.goals)
    true = planners.guided_true.problem(shared, problem.goals)
    situation = engaged.situation
    limits = situation.bend_limits
    starts = problem.starts * situation.longest_step + situation.last.bends

    def project(bends: Bends) -> Bends:
        return engaged.within_step(limit_lengths(bends, limits))

    return _compare(plan, engaged, true, starts, project)


def _after_settling(planners: _Planners, problem: PlanningProblems) -> Comparison:
    step = planners.guided

    def repeat(plan: Plan, _) -> tuple[Plan, None]:
        return step.next_plan(plan, plan.configurations, problem.goals), None

    first = step.started(problem.histories[-1])
    last, _ = jax.lax.scan(repeat, first, None, length=SETTLING)
    plan = step.next_plan(last, last.configurations, problem.goals)
    shared = last._replace(memory=plan.memory)
    engaged = planners.unguided.problem(shared, problem.goals)
    true = planners.unguided_true.problem(shared, problem.goals)
    limits = engaged.situation.bend_limits
    starts = problem.starts * limits[:, None]

    def project(bends: Bends) -> Bends:
        return limit_lengths(bends, limits)

    return _compare(plan, engaged, true, starts, project)


def _compare(
    plan: Plan,
    engaged: Problem,
    true: Problem,
    starts: Array | np.ndarray,
    project: Projection,
) -> Comparison:
    """Compare a plan with searches from the starts and from the plan itself."""
    situation = engaged.situation
    bends = bends_from_configurations(plan.configurations)
    starts = jnp.concatenate([starts, bends[None]])

    def search_from(start: Bends) -> Float[Array, ""]:
        bends, _ = solve_least_squares(engaged.stacked, start, project, ITERATIONS)
        return solve_least_squares(true.stacked, bends, project, ITERATIONS)[1]

    costs = jax.vmap(search_from)(starts)
    step_length = largest_bend(bends - situation.last.bends)
    return Comparison(
        jnp.sum(engaged.stacked(bends) ** 2),
        costs.min(),
        step_length > LIMITED * situation.longest_step,
    )


def compare_with_long_search(
    arm: ArmSpec,
    model: ForwardModel,
    options: PlannerOptions,
    count: int,
    seed: int = 0,
) -> dict[str, Comparison]:
    """Compare plans after one step, and plans that have settled.

    Args:
        arm: its planning limits count.
        model: predicts states.
        options: of the planner.
        count: number of problems.
        seed: of all samples.
    """
    problems = sample_problems(arm, model, count, seed)
    planners = _Planners.of(arm, model, options)
    programs = {"one step": _after_one_step, "settled": _after_settling}
    return {
        name: compiled(_for_each, compare, planners)(problems)
        for name, compare in programs.items()
    }


def _for_each(
    compare: Callable[[_Planners, PlanningProblems], Comparison],
    planners: _Planners,
    problems: PlanningProblems,
) -> Comparison:
    return jax.lax.map(partial(compare, planners), problems, batch_size=CHUNK)


def plan_rows(
    networks: Sequence[TrainedNetworks],
    count: int,
    seed: int = 0,
    keep: Callable[[list[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Make rows of the shares of optimal and stuck plans [%], of all kinds and each.

    Args:
        networks: each plans with the options of its recipe.
        count: number of problems for each.
        seed: of all samples.
        keep: called with all rows so far whenever networks are finished, so that an
            interruption loses none.
    """
    rows: list[Row] = []
    kinds = np.array(KINDS)[np.arange(count) % 4]
    for each in networks:
        arm = each.arm
        recipe = each.recipe
        comparisons = compare_with_long_search(
            arm, each.c2s, recipe.planner, count, seed
        )
        for when, comparison in comparisons.items():
            metrics = {
                "within 5 % or bound": comparison.optimal,
                "standing": comparison.stuck,
            }
            for kind in ("all", *KINDS):
                selected = (kinds == kind) | (kind == "all")
                task = f"{when}: {kind}"
                heading = ("plans", task, arm.name, "none", "s2c2a", recipe.name)
                for metric, values in metrics.items():
                    share = 100.0 * float(values[selected].mean())
                    rows.append(Row(*heading, metric, "%", share, seeds=(seed,)))
        keep(rows)
    return rows
