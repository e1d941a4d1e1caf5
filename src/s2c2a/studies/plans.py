"""Drawn plans beside a long search: how many stand although their cost could fall.

Arms wander as data make them, so that their cables remember something; then each is
given a goal of its own. A plan is held against many starts with engaged and true
slopes: after one step, within the step's limit and for the goal as guides have led it;
and after `SETTLING` steps, without that limit and for the goal as it was asked.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.babbling import bend_path
from s2c2a.evaluation import Row
from s2c2a.kinematics import (
    ForwardModel,
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.planning import Goal, Plan, PlannerOptions
from s2c2a.planning.planner import Step
from s2c2a.planning.solvers import Problem, Projection, solve_least_squares
from s2c2a.planning.terms import Bends, Numbers, largest_bend
from s2c2a.compilation import compiled
from s2c2a.strategies import TrainedNetworks

KINDS = ("tip", "tip and axis", "middle and tip", "anywhere")
# steps
WANDERING = 40
SETTLING = 60
# of the long search, twice as many iterations with both slopes
STARTS = 24
ITERATIONS = 30
# of the long search's cost; of the step's limit
WITHIN = 1.05
BOUND = 0.999
WORTH = 1.5e-4  # of a cost that counts as standing: 3 mm off at the tip
CHUNK = 250


class Drawn(NamedTuple):
    """Problems, with their number in front.

    Attributes:
        walks: sensed configurations, module frames, shape (problems, steps, modules,
            3).
        goals: one for each.
        starts: of the long search, bends in the unit disc, shape (problems, starts,
            modules, 2).
    """

    walks: Float[Numbers, "problems steps modules 3"]
    goals: Goal
    starts: Float[Numbers, "problems starts modules 2"]


class Held(NamedTuple):
    """Plans beside a long search; costs are sums of mu |r|^2, all of shape (problems,).

    Attributes:
        cost: of the plan.
        least: of what the long search found.
        bound: whether the step's limit binds.
    """

    cost: Float[Numbers, " problems"]
    least: Float[Numbers, " problems"]
    bound: Bool[Numbers, " problems"]

    @property
    def good(self) -> np.ndarray:
        """Within 5 % of the long search's, or bound."""
        return np.asarray(self.bound | (self.cost <= WITHIN * self.least))

    @property
    def standing(self) -> np.ndarray:
        """Not good, and by more than 3 mm are worth at the tip."""
        return ~self.good & (np.asarray(self.cost - self.least) > WORTH)


def drawn(arm: ArmSpec, model: ForwardModel, count: int, seed: int) -> Drawn:
    """Walks and goals at random: ends of shapes that the arm can take, and for a quarter any point near it."""
    random = np.random.default_rng(seed)
    modules = arm.module_count
    limits = ArmGeometry.of(arm).planned_bends[:, None]
    paths = np.array(
        [[bend_path(WANDERING, random) for _ in range(modules)] for _ in range(count)]
    )
    walks = configurations_from_bends(
        jnp.asarray(np.moveaxis(paths, 1, 2) * limits, jnp.float32)
    )
    shapes = configurations_from_bends(
        jnp.asarray(_discs(random, (count, modules)) * limits, jnp.float32)
    )
    ends = np.asarray(
        jax.vmap(lambda shape: model.predict(shape, model.start(shape)))(shapes)
    )
    goals = Goal.stacked(
        [_goal(KINDS[number % 4], one, arm, random) for number, one in enumerate(ends)]
    )
    goals = goals._replace(
        obstacles=goals.obstacles[:, :0], thresholds=goals.thresholds[:, :0]
    )
    return Drawn(
        np.asarray(walks),
        goals,
        _discs(random, (count, STARTS, modules)).astype(np.float32),
    )


def _discs(random: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    angles = random.uniform(0, 2 * np.pi, shape)
    return np.sqrt(random.uniform(size=shape))[..., None] * np.stack(
        [np.cos(angles), np.sin(angles)], axis=-1
    )


def _goal(
    kind: str, states: np.ndarray, arm: ArmSpec, random: np.random.Generator
) -> Goal:
    goal = Goal.of(arm.module_count)
    middle = (arm.module_count - 1) // 2
    if kind == "anywhere":
        return goal.with_position(
            arm.length * random.uniform([-1.0, -1.0, 0.3], [1.0, 1.0, 1.1])
        )
    if kind == "middle and tip":
        goal = goal.with_position(states[middle, :3], 4.0, module=middle)
    if kind == "tip and axis":
        goal = goal.with_axis(states[-1, 3:])
    return goal.with_position(states[-1, :3])


class _Ways(NamedTuple):
    """The planner's step, the same without guides, and both with true slopes."""

    led: Step
    led_true: Step
    asked: Step
    asked_true: Step

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel, options: PlannerOptions) -> "_Ways":
        unled = replace(options, guides=())
        every = (
            options,
            replace(options, engaged_slopes=False),
            unled,
            replace(unled, engaged_slopes=False),
        )
        return cls(*(Step.of(arm, model, one) for one in every))


def _after_one_step(ways: _Ways, problem: Drawn) -> Held:
    step = ways.led
    plan = step.started(problem.walks[0])
    walk = jnp.asarray(problem.walks)
    memory, _ = jax.lax.scan(
        lambda memory, one: (step.model.observe(one, memory), None), plan.memory, walk
    )
    plan = plan._replace(configurations=problem.walks[-1], memory=memory)
    return _held(ways.led, ways.led_true, plan, problem, settled=False)


def _after_settling(ways: _Ways, problem: Drawn) -> Held:
    def on(plan: Plan, _) -> tuple[Plan, None]:
        return ways.led.next_plan(plan, plan.configurations, problem.goals), None

    step = ways.led
    plan, _ = jax.lax.scan(on, step.started(problem.walks[-1]), None, length=SETTLING)
    return _held(ways.asked, ways.asked_true, plan, problem, settled=True, planner=step)


def _held(
    engaged: Step,
    true: Step,
    last: Plan,
    drawn: Drawn,
    settled: bool,
    planner: Step | None = None,
) -> Held:
    """The next plan beside the long search."""
    plan = (planner or engaged).next_plan(last, last.configurations, drawn.goals)
    problem, truly = (
        one.problem(last.configurations, plan.memory, drawn.goals)
        for one in (engaged, true)
    )
    situation = problem.situation
    bends = bends_from_configurations(plan.configurations)
    limits = situation.bend_limits
    scale = limits[:, None] if settled else situation.longest_step
    starts = drawn.starts * scale + (0.0 if settled else situation.last.bends)

    def project(bends: Bends) -> Bends:
        allowed = limit_lengths(bends, limits)
        return allowed if settled else problem.within_step(allowed)

    costs = _searched(problem, truly, jnp.concatenate([starts, bends[None]]), project)
    moved = largest_bend(bends - situation.last.bends)
    return Held(
        problem.judged(problem.looked_at(bends)),
        costs.min(),
        moved > BOUND * situation.longest_step,
    )


def _searched(
    problem: Problem, truly: Problem, starts: Array, project: Projection
) -> Float[Array, " starts"]:
    def from_one(start: Bends) -> Float[Array, ""]:
        found, _ = solve_least_squares(problem.stacked, start, project, ITERATIONS)
        return solve_least_squares(truly.stacked, found, project, ITERATIONS)[1]

    return jax.vmap(from_one)(starts)


def held_against_long_search(
    arm: ArmSpec,
    model: ForwardModel,
    options: PlannerOptions,
    count: int,
    seed: int = 0,
) -> dict[str, Held]:
    """Plans after one step, and once they have settled.

    Args:
        arm: its limits count.
        model: predicts states.
        options: how to plan.
        count: of problems.
        seed: of all that is drawn.
    """
    problems = drawn(arm, model, count, seed)
    ways = _Ways.of(arm, model, options)
    programs = {"one step": _after_one_step, "settled": _after_settling}
    return {
        name: _in_chunks(compiled(_each, work, ways), problems)
        for name, work in programs.items()
    }


def _each(work: Callable[[_Ways, Drawn], Held], ways: _Ways, problems: Drawn) -> Held:
    return jax.vmap(lambda problem: work(ways, problem))(problems)


def _in_chunks(program: Callable[[Drawn], Held], problems: Drawn) -> Held:
    count = len(problems.walks)
    parts = []
    for begin in range(0, count, CHUNK):
        # one size, so that nothing compiles anew
        rows = np.minimum(np.arange(begin, begin + CHUNK), count - 1)
        part = program(jax.tree.map(lambda values, rows=rows: values[rows], problems))
        parts.append(jax.tree.map(np.asarray, part))
    return Held(
        *(np.concatenate(values)[:count] for values in zip(*parts, strict=True))
    )


@dataclass(frozen=True)
class _Share:
    metric: str
    of: Callable[[Held], np.ndarray]


SHARES = (
    _Share("within 5 % or bound", lambda held: held.good),
    _Share("standing", lambda held: held.standing),
)


def plan_rows(every: Sequence[TrainedNetworks], count: int, seed: int = 0) -> list[Row]:
    """Shares [%] of drawn plans, of all kinds together and of each, for every file of networks.

    Args:
        every: networks, planning as their recipes say.
        count: of plans.
        seed: of all that is drawn.
    """
    rows = []
    for networks in every:
        arm = networks.arm
        recipe = networks.recipe
        for when, held in held_against_long_search(
            arm, networks.c2s, recipe.planner, count, seed
        ).items():
            kinds = np.array(KINDS)[np.arange(count) % 4]
            for kind in ("all", *KINDS):
                chosen = (kinds == kind) | (kind == "all")
                for share in SHARES:
                    value = 100.0 * float(share.of(held)[chosen].mean())
                    heading = (
                        "plans",
                        f"{when}: {kind}",
                        arm.name,
                        "none",
                        "s2c2a",
                        recipe.name,
                    )
                    rows.append(Row(*heading, share.metric, "%", value, seeds=(seed,)))
    return rows
