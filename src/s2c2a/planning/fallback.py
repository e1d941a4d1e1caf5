"""Fallback search: random restarts when the plan is stuck.

A planner with the slopes of taut cables (`ForwardModel.for_planning`) can stop although
the cost could fall: these slopes can point uphill, and the best shape can lie behind
worse ones. Where a plan makes no progress, the fallback search solves again with true
slopes, from the plan and from random samples: within the step limit, and over all
shapes of the arm. It moves towards a far better shape over several steps.

The search is part of the compiled control step. Where no plan is stuck, its loops make
no iteration, also in a batch.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from s2c2a.components import Component, Registry
from s2c2a.goals import Goal
from s2c2a.kinematics import limit_lengths
from s2c2a.planning.outcomes import STILL, Outcome
from s2c2a.planning.solvers import Problem, solve_least_squares
from s2c2a.planning.terms import Bends, Candidate, largest_bend

SAMPLES = 64  # random shapes, taken in turn
AT_STEP_LIMIT = 0.999  # of the step limit: the step limit is active
PROGRESS = 0.9  # of the cost before: a plan that leaves less makes progress
STILL_STEPS = 20  # steps; the arm has been still for long
STUCK_STEPS = 5  # steps; a plan that follows a moving goal is left alone as long
MAX_WAIT = 8  # steps between two searches without success
FAR_COST = 0.05  # of a plan that is far from its goal: 6 cm at the tip
REFINING_ITERATIONS = 3  # for the shape that the plan moves towards
# largest share of the cost that another shape may leave
MOVING_SHARE = 0.5  # where the plan moves
STILL_SHARE = 0.95  # where the plan has been still for long

Count = Int[Array, ""]
Flag = Bool[Array, ""]
Cost = Float[Array, ""]


class SearchState(NamedTuple):
    """Diagnostics and counters of the fallback search, integers of shape ().

    Attributes:
        approaching: 1 while the plan moves towards the stored shape.
        searches: number of searches so far; selects the random samples.
        wait: steps until the next search.
        last_wait: steps waited after the last search without success.
        still_steps: steps in a row in which the plan was still.
        stuck_steps: steps in a row in which the plan was stuck.
        outcome: of the last step (`Outcome`).
    """

    approaching: Count
    searches: Count
    wait: Count
    last_wait: Count
    still_steps: Count
    stuck_steps: Count
    outcome: Count

    @property
    def is_replaced(self) -> Bool[Array, ""]:
        """Whether the fallback search replaced the solver's plan."""
        return (self.outcome > Outcome.SOLVED) & (self.outcome < Outcome.STUCK)


class Search(NamedTuple):
    """Memory of the fallback search.

    The integers are packed, since each array costs microseconds on its way into the
    compiled step and out of it.

    Attributes:
        shape: best other shape so far, as bends [rad], shape (modules, 2).
        numbers: the packed `SearchState`, shape (fields,).
    """

    shape: Bends
    numbers: Int[Array, " fields"]

    @classmethod
    def none(cls, bends: Bends) -> "Search":
        """The memory of an arm at rest."""
        return cls(bends, jnp.zeros(len(SearchState._fields), jnp.int32))

    @classmethod
    def pack(cls, shape: Bends, state: SearchState) -> "Search":
        """The memory with these counters."""
        integers = [jnp.asarray(value, jnp.int32) for value in state]
        return cls(shape, jnp.stack(integers))

    def with_outcome(self, outcome: Count) -> "Search":
        """The same memory with another outcome of this step."""
        return self.pack(self.shape, self.state._replace(outcome=outcome))

    @property
    def state(self) -> SearchState:
        """The unpacked counters; of a batch, each with the batch axes in front."""
        return SearchState(*jnp.moveaxis(self.numbers, -1, 0))


@dataclass(frozen=True)
class FallbackSearch(Component):
    """Random restarts where the plan is stuck. Costs are sums of mu |r|^2.

    Attributes:
        starts: random samples of each search; with zero there is no fallback.
        iterations: of least squares from each sample.
        least: smallest cost, and smallest gain, worth a move while the goal moves:
            8 mm at the tip. The memory of the cables makes shapes look better for one
            step that are worse in the next.
        slight: the same where the plan has been still for long: 3 mm.
        seed: of the samples.
    """

    starts: int = 6
    iterations: int = 12
    least: float = 1e-3
    slight: float = 1.5e-4
    seed: int = 0

    def improve(
        self,
        guided: Problem,
        goal: Goal,
        candidate: Candidate,
        search: Search,
        is_disturbed: Flag,
    ) -> tuple[Bends, Search]:
        """The solver's plan or a better one, as bends [rad], and the new memory.

        Args:
            guided: the problem of this step, with true slopes.
            goal: the goal before the guides changed it.
            candidate: the solver's plan within its limits, with its prediction.
            search: memory of the last step.
            is_disturbed: whether a payload or bend biases act on the arm. What they do
                to another shape is uncertain, and a plan that changes between two
                shapes makes the arm vibrate. So there is no search unless the plan is
                stuck far from its goal.
        """
        last = guided.situation.last
        state = search.state
        approaching = state.approaching > 0
        unguided = guided.with_goal(goal)
        before = _Costs(unguided.cost_of(last), guided.cost_of(last))
        after = _Costs(unguided.cost_of(candidate), guided.cost_of(candidate))
        # near obstacles a guide may first move away from the goal
        unobstructed = ~(guided.situation.goal.thresholds > 0.0).any()
        # otherwise a misleading guide would make the plan oscillate
        keep = (
            unobstructed
            & (after.unguided > before.unguided)
            & (after.guided < before.guided)
        )
        planned = jnp.where(keep, last.bends, candidate.bends)
        after = jax.tree.map(partial(jnp.where, keep), before, after)
        progress = self._progress(guided, planned, before, after, state)

        is_far = (after.unguided > FAR_COST) & (progress.stuck_steps > STUCK_STEPS)
        may_search = ~is_disturbed | is_far
        searching = progress.stuck & ~approaching & (state.wait <= 0) & may_search
        near, far = jax.lax.cond(
            searching | approaching,
            partial(self._search, guided, unguided, planned, search, searching),
            lambda: (_without_cost(planned), _without_cost(search.shape)),
        )
        restart = searching & progress.restart_pays(near.cost)
        better = approaching | (searching & progress.move_pays(far.cost, restart))
        better &= far.cost < progress.allowed_cost(approaching)
        move = better & unobstructed

        failed = searching & ~restart & ~better
        longer_wait = jnp.clip(2 * state.last_wait, 1, MAX_WAIT)
        last_wait = jnp.where(failed, longer_wait, state.last_wait)
        distance = largest_bend(far.bends - last.bends)
        state = SearchState(
            approaching=move & (distance > guided.situation.longest_step),
            searches=state.searches + searching,
            wait=jnp.where(failed, last_wait, state.wait - 1),
            last_wait=jnp.where(progress.stuck | approaching, last_wait, 0),
            still_steps=progress.still_steps,
            stuck_steps=progress.stuck_steps,
            outcome=_outcome(keep, restart, move, better),
        )
        bends = jnp.where(restart, near.bends, planned)
        bends = jnp.where(move, guided.within_step(far.bends), bends)
        return bends, Search.pack(far.bends, state)

    def _progress(
        self,
        guided: Problem,
        planned: Bends,
        before: "_Costs",
        after: "_Costs",
        state: SearchState,
    ) -> "_Progress":
        situation = guided.situation
        step = largest_bend(planned - situation.last.bends) / situation.longest_step
        still_steps = jnp.where(step < STILL, state.still_steps + 1, 0)
        min_gain = jnp.where(still_steps > STILL_STEPS, self.slight, self.least)
        slow = after.unguided > PROGRESS * before.unguided
        progresses = ~slow & (after.guided <= PROGRESS * after.unguided)
        limited = step >= AT_STEP_LIMIT
        stuck = (after.unguided > min_gain) & ~progresses & (~limited | slow)
        stuck_steps = jnp.where(stuck, state.stuck_steps + 1, 0)
        return _Progress(stuck, min_gain, still_steps, stuck_steps, after)

    def _search(
        self,
        guided: Problem,
        unguided: Problem,
        planned: Bends,
        search: Search,
        searching: Flag,
    ) -> "tuple[_Result, _Result]":
        """The best shape within the step limit, and the best of all shapes.

        A shape that the plan moves towards is only refined. One program solves from all
        starts, since each program takes seconds to compile; what differs between starts
        is data.
        """
        state = search.state
        situation = guided.situation
        last = situation.last.bends
        limits = situation.bend_limits
        samples = self._samples(last, state.searches)
        within = last + situation.longest_step * samples[: self.starts // 2]
        stored = len(within) + 1  # number of the start at the stored shape
        starts = jnp.concatenate(
            [planned[None], within, search.shape[None], limits[:, None] * samples]
        )
        numbers = jnp.arange(len(starts))
        near = numbers < stored
        refining = state.approaching > 0
        iterations = jnp.where(refining, REFINING_ITERATIONS, -1)
        iterations = jnp.where(searching, self.iterations, iterations)

        def solve(start: Bends, near: Flag) -> _Result:
            goal = jax.tree.map(
                partial(jnp.where, near), situation.goal, unguided.situation.goal
            )

            def project(bends: Bends) -> Bends:
                allowed = limit_lengths(bends, limits)
                return jnp.where(near, guided.within_step(bends), allowed)

            residuals = guided.with_goal(goal).stacked
            return _Result(*solve_least_squares(residuals, start, project, iterations))

        results = jax.vmap(solve)(starts, near)
        excluded = near | (refining & (numbers != stored))
        best_near = jnp.argmin(jnp.where(near, results.cost, jnp.inf))
        best_far = jnp.argmin(jnp.where(excluded, jnp.inf, results.cost))
        best_far = jnp.where(searching, best_far, stored)
        return results.at(best_near), results.at(best_far)

    def _samples(
        self, like: Bends, searches: Count
    ) -> Float[Array, "starts modules 2"]:
        """The next random samples in turn; bends are in the unit disc."""
        random = np.random.default_rng(self.seed)
        angles = random.uniform(0, 2 * np.pi, (SAMPLES, len(like)))
        radii = np.sqrt(random.uniform(size=angles.shape))
        directions = np.stack([np.cos(angles), np.sin(angles)], -1)
        samples = jnp.asarray(radii[..., None] * directions, like.dtype)
        numbers = searches * self.starts + jnp.arange(self.starts)
        return samples[numbers % SAMPLES]


class _Costs(NamedTuple):
    """Costs of one plan with the goal as requested and as the guides changed it."""

    unguided: Cost
    guided: Cost


class _Progress(NamedTuple):
    """How the plan progresses, and what a better plan must gain."""

    stuck: Flag
    min_gain: Cost
    still_steps: Count
    stuck_steps: Count
    costs: _Costs

    def restart_pays(self, cost: Cost) -> Flag:
        """Whether a restart within the step limit is enough better."""
        planned = self.costs.guided
        return (cost < STILL_SHARE * planned) & (planned - cost > self.min_gain)

    def move_pays(self, cost: Cost, restart: Flag) -> Flag:
        """Whether a move over several steps is worth its start."""
        waited = self.stuck_steps > STUCK_STEPS
        ready = ((self.still_steps > 0) & ~restart) | waited
        return (self.costs.unguided - cost > self.min_gain) & ready

    def allowed_cost(self, approaching: Flag) -> Cost:
        """Largest cost of a shape to move towards."""
        stillness = jnp.minimum(self.still_steps / STILL_STEPS, 1.0)
        share = MOVING_SHARE + (STILL_SHARE - MOVING_SHARE) * stillness
        return jnp.where(approaching, 1.0, share) * self.costs.unguided


class _Result(NamedTuple):
    """Bends of a solution and their cost."""

    bends: Bends
    cost: Cost

    def at(self, number: Count) -> "_Result":
        """One of several results."""
        return _Result(self.bends[number], self.cost[number])


def _without_cost(bends: Bends) -> _Result:
    return _Result(bends, jnp.asarray(jnp.inf))


def _outcome(keep: Flag, restart: Flag, move: Flag, better: Flag) -> Count:
    outcome = jnp.where(better, Outcome.STUCK, Outcome.SOLVED)
    outcome = jnp.where(keep, Outcome.KEPT, outcome)
    outcome = jnp.where(restart, Outcome.RESTARTED, outcome)
    return jnp.where(move, Outcome.FALLBACK, outcome)


NO_FALLBACK = FallbackSearch(starts=0)
"""No search: the plan stays stuck."""
FALLBACKS: Registry[FallbackSearch] = Registry(
    "fallback", FallbackSearch, {"FallbackSearch": FallbackSearch}
)
