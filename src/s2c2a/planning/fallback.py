"""What takes over where a plan stands although its cost could fall.

Slopes of taut cables that follow their motors (`ForwardModel.for_planning`) can point
uphill, and the best shape of all can lie behind shapes that are worse. So where a plan
gets no nearer to its goal, or not as near as it could without moving by a whole step,
true slopes try from there and from a few other shapes within the step; and shapes drawn
from all that the arm can be search without the step's limit. One that is far better is
led to, some steps long, and kept in mind on the way.

All of it is in the compiled step: where nothing stands its loops turn no time, also in
a batch.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from s2c2a.goals import Goal
from s2c2a.kinematics import limit_lengths
from s2c2a.components import Kind, Part
from s2c2a.planning.solvers import Problem, solve_least_squares
from s2c2a.planning.terms import Bends, largest_bend

STAYED = 1
OTHER_START = 2
LED = 3
"""Stayed where it was, since the plan led away from the goal as asked; true slopes or
another start; another shape."""
DRAWN = 64  # shapes, taken one after the other
BOUND = 0.999  # of the step's limit: it binds
FALLING = 0.9  # of the cost before: a plan that leaves less does not stand
STILL = 0.05  # of the step's limit: a plan that moves less is still
# of the cost: what another shape may leave, where the goal moves and where all has been
# still
SOON = 0.5
LATE = 0.95
STILL_LONG = 20  # steps
STOOD_LONG = 5  # steps; a plan that follows a goal is left alone as long
LONGEST_WAIT = 8  # steps between two searches in vain
REFINING = 3  # iterations for a shape that is led to
Count = Int[Array, ""]


class Notes(NamedTuple):
    """What is kept in mind from step to step beside a shape; whole numbers, one and zero for yes and no.

    Attributes:
        led: whether that shape is led to.
        turn: how many searches there were.
        wait: steps until the next one.
        last_wait: after the last search in vain.
        still: steps for which all has been still.
        stood: steps for which the plan stood, in a row.
        rescued: 0, or what took over in this step: `STAYED`, `OTHER_START` or `LED`.
        standing: whether the plan stands although a shape is known that would serve
            better.
    """

    led: Count
    turn: Count
    wait: Count
    last_wait: Count
    still: Count
    stood: Count
    rescued: Count
    standing: Count


class Search(NamedTuple):
    """What is kept in mind; few arrays, since each costs microseconds on its way into the program and out of it.

    Attributes:
        shape: bends [rad], shape (modules, 2).
        numbers: of `Notes`, shape (notes,).
    """

    shape: Bends
    numbers: Int[Array, " notes"]

    @classmethod
    def none(cls, bends: Bends) -> "Search":
        """At rest."""
        return cls(bends, jnp.zeros(len(Notes._fields), jnp.int32))

    @property
    def notes(self) -> Notes:
        """By name."""
        return Notes(*(self.numbers[place] for place in range(len(Notes._fields))))


@dataclass(frozen=True)
class FallbackSearch(Part):
    """See the module. Costs are sums of mu |r|^2.

    Attributes:
        starts: shapes that a search begins from; none, and nothing is rescued or
            noticed.
        iterations: of each.
        least: a cost below it, or less of it to gain, is not worth a move where the
            goal moves: 8 mm off at the tip. What cables remember makes shapes look
            better for a step that are worse in the next.
        slight: the same where all has been still: 3 mm.
        seed: of the shapes.
    """

    starts: int = 6
    iterations: int = 12
    least: float = 1e-3
    slight: float = 1.5e-4
    seed: int = 0

    def over(
        self, step: Problem, asked: Goal, planned: Bends, search: Search
    ) -> tuple[Bends, Search]:
        """The solver's plan or a better one, as bends [rad], and what is kept in mind.

        Args:
            step: the step's problem, with true slopes.
            asked: the goal before guides changed it.
            planned: by the solver, within its limits.
            search: kept in mind.
        """
        situation = step.situation
        free = step.asking(asked)
        notes = search.notes
        led = notes.led > 0
        here = step.looked_at(planned)
        before = free.judged(situation.last)
        # round obstacles guides know the way
        unhindered = ~(situation.goal.thresholds > 0.0).any()
        now = free.judged(here)
        local = step.judged(here)
        local_before = step.judged(situation.last)
        # a guide misled the solver: it would come and go
        back = unhindered & (now > before) & (local < local_before)
        planned = jnp.where(back, situation.last.bends, planned)
        now = jnp.where(back, before, now)
        local = jnp.where(back, local_before, local)
        moved = largest_bend(planned - situation.last.bends) / situation.longest_step
        still = jnp.where(moved < STILL, notes.still + 1, 0)
        worth = jnp.where(still > STILL_LONG, self.slight, self.least)
        falls = (now <= FALLING * before) & (local <= FALLING * now)
        stands = (now > worth) & ~falls & ((moved < BOUND) | (now > FALLING * before))
        stood = jnp.where(stands, notes.stood + 1, 0)
        seeks = stands & ~led & (notes.wait <= 0)
        nothing = (
            _Found(planned, jnp.asarray(jnp.inf)),
            _Found(search.shape, jnp.asarray(jnp.inf)),
        )
        found = partial(self._found, step, free, planned, search, seeks)
        near, shape = jax.lax.cond(seeks | led, found, lambda: nothing)
        gained = seeks & (near.cost < LATE * local) & (local - near.cost > worth)
        left = jnp.where(
            led, 1.0, SOON + (LATE - SOON) * jnp.minimum(still / STILL_LONG, 1.0)
        )
        worth_it = (
            seeks
            & (now - shape.cost > worth)
            & (((still > 0) & ~gained) | (stood > STOOD_LONG))
        )
        better = (led | worth_it) & (shape.cost < left * now)
        leads = better & unhindered
        in_vain = seeks & ~gained & ~better
        last_wait = jnp.where(
            in_vain, jnp.clip(2 * notes.last_wait, 1, LONGEST_WAIT), notes.last_wait
        )
        kept = Notes(
            led=leads
            & (
                largest_bend(shape.bends - situation.last.bends)
                > situation.longest_step
            ),
            turn=notes.turn + seeks,
            wait=jnp.where(in_vain, last_wait, notes.wait - 1),
            last_wait=jnp.where(stands | led, last_wait, 0),
            still=still,
            stood=stood,
            rescued=jnp.where(
                leads, LED, jnp.where(gained, OTHER_START, jnp.where(back, STAYED, 0))
            ),
            standing=better & ~unhindered,
        )
        return jnp.where(
            leads, step.within_step(shape.bends), jnp.where(gained, near.bends, planned)
        ), Search(shape.bends, jnp.stack([jnp.asarray(one, jnp.int32) for one in kept]))

    def _found(
        self, step: Problem, free: Problem, planned: Bends, search: Search, seeks
    ) -> "tuple[_Found, _Found]":
        """The best within the step, and the best of all; a shape that is led to is no more than kept up to date.

        One program for both, since every one costs seconds to compile: what differs
        goes in as numbers.
        """
        led = search.notes.led > 0
        last = step.situation.last.bends
        limits = step.situation.bend_limits
        drawn = self._drawn(last, search.notes.turn)
        within = last + step.situation.longest_step * drawn[: self.starts // 2]
        starts = jnp.concatenate(
            [planned[None], within, search.shape[None], limits[:, None] * drawn]
        )
        near = jnp.arange(len(starts)) <= len(within)
        iterations = jnp.where(seeks, self.iterations, jnp.where(led, REFINING, -1))

        def from_one(start: Bends, near) -> _Found:
            goal = jax.tree.map(
                partial(jnp.where, near), step.situation.goal, free.situation.goal
            )

            def project(bends: Bends) -> Bends:
                return jnp.where(
                    near, step.within_step(bends), limit_lengths(bends, limits)
                )

            problem = step.asking(goal)
            return _Found(
                *solve_least_squares(problem.stacked, start, project, iterations)
            )

        found = jax.vmap(from_one)(starts, near)
        kept = jnp.arange(len(starts)) == len(within) + 1
        best_near = jnp.argmin(jnp.where(near, found.cost, jnp.inf))
        best_far = jnp.argmin(jnp.where(near | (led & ~kept), jnp.inf, found.cost))
        best_far = jnp.where(seeks, best_far, len(within) + 1)
        near_one, far_one = (
            _Found(found.bends[one], found.cost[one]) for one in (best_near, best_far)
        )
        return near_one, far_one

    def _drawn(self, like: Bends, turn) -> Float[Array, "starts modules 2"]:
        """The next shapes in line; bends are in the unit disc."""
        random = np.random.default_rng(self.seed)
        angles = random.uniform(0, 2 * np.pi, (DRAWN, len(like)))
        shapes = np.sqrt(random.uniform(size=angles.shape))[..., None] * np.stack(
            [np.cos(angles), np.sin(angles)], -1
        )
        return jnp.asarray(shapes, like.dtype)[
            (turn * self.starts + jnp.arange(self.starts)) % DRAWN
        ]


class _Found(NamedTuple):
    bends: Bends
    cost: Float[Array, ""]


NO_FALLBACK = FallbackSearch(starts=0)
FALLBACKS = Kind.of("fallback", FallbackSearch, FallbackSearch)
