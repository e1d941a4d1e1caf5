"""A plan over a horizon: the bends of the next second, planned together.

Every control step shifts the last plan by one step and improves it by a few iterations
(the real-time iteration of Diehl, Bock and Schlöder, SIAM J. Control Optim. 43, 2005).
Each knot has the terms of the objective; changes of bends, and changes of these changes,
cost too, so plans are smooth, and a plan moves before its goal does.

Every iteration takes its damped step, also where it costs more than before: the slopes
are those of taut cables, which can point uphill inside a backlash, and a plan that waits
for a slope that points downhill stands still. Beside obstacles, such a step is shortened,
since iterations would go to and fro across their edges, beyond which the curvature is
another one. Far from a goal the damping is
larger, since Gauss-Newton leaves out the curvature of what stays of the residual (Fan and
Yuan, Computing 74, 2005). The cheapest of the iterates is taken, the later of equal ones.

The forward model stands in the program once: each pass of one loop evaluates it, with its
slopes, at the last plan and all knots. The last pass predicts what was planned.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from s2c2a.execution.compilation import select
from s2c2a.goals import PREVIEW
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.kinematics.bends import Scalar
from s2c2a.models.forward_model import Memory
from s2c2a.planning.motion import GoalMotion
from s2c2a.planning.solvers import Problem, Solution, Solver
from s2c2a.planning.terms import Bends, Candidate, Configurations
from s2c2a.spaces import POSITION

Knots = Float[Array, "knots modules 2"]
# measured in docs/results/failed-experiments.md#a-horizon
DAMPING = 1e-2  # of squared slopes near one, since residuals are scaled
FAR_DAMPING = 0.1  # further damping, of the squared residual
ROUNDING = np.sqrt(np.finfo(np.float32).eps)
"""Of costs: their last bit moves the minimum by its root."""
SHARES = 0.5 ** np.arange(4.0, dtype=np.float32)  # of a step beside obstacles


class HorizonMemory(NamedTuple):
    """What a horizon remembers.

    Attributes:
        knots: planned bends [rad].
        before: bends before the last step [rad].
    """

    knots: Knots
    before: Bends


class _Expansion(NamedTuple):
    """The cost of knots, to second order.

    Attributes:
        knots: where it is expanded [rad].
        cost: the sum of squares of all terms, and of changes.
        gradients: half of its gradient at every knot, shape (knots, bends).
        blocks: half of its damped curvature there, without changes, shape (knots,
            bends, bends).
    """

    knots: Knots
    cost: Scalar
    gradients: Float[Array, "knots bends"]
    blocks: Float[Array, "knots bends bends"]


class _Search(NamedTuple):
    """The state of the loop before a pass.

    Attributes:
        accepted: number of knots that were accepted; those at the start are the first.
        rejected: number of steps that were rejected since then.
        here: bends that are evaluated beside the knots: of the last plan, and in the
            last pass of the next one [rad].
        knots: that are evaluated [rad].
        memories: of the forward model before every knot.
        base: knots that were accepted last.
        full: knots after the full step from there [rad].
        cheapest: of the shortened steps.
        best: the cheapest knots that were accepted after the start.
        last: the last plan, known after the first pass.
        motion: of the goals, known after the first pass.
        evaluated: in this pass, beside the knots and at the knots.
    """

    accepted: Int[Array, ""]
    rejected: Int[Array, ""]
    here: Bends
    knots: Knots
    memories: Memory
    base: _Expansion
    full: Knots
    cheapest: _Expansion
    best: _Expansion
    last: Candidate
    motion: GoalMotion
    evaluated: Candidate


@dataclass(frozen=True)
class Horizon(Solver):
    """Damped Gauss-Newton on the bends at all knots of a horizon.

    A knot comes every `goals.PREVIEW_INTERVAL`, or every control step if that is longer.

    Attributes:
        iterations: in a control step.
        change: cost of a change of bends from knot to knot [1/rad].
        acceleration: cost of a change of this change [1/rad].
    """

    iterations: int = 2
    change: float = 0.03
    acceleration: float = 0.5

    looks_ahead = True

    def start(self, bends: Bends) -> HorizonMemory:
        return HorizonMemory(jnp.tile(bends, (PREVIEW, 1, 1)), bends)

    def solve(self, problem: Problem) -> Configurations:
        start = self.start(problem.situation.last.bends)
        return self.next(problem, start).planned.configurations

    def next(self, problem: Problem, memory: HorizonMemory) -> Solution:
        last = problem.situation.last.bends
        has_target = problem.situation.goal.has_target
        following = jnp.concatenate([memory.knots[1:], memory.knots[-1:]])
        shifted = memory.knots + (following - memory.knots) / problem.stride
        # an arm that has lost its target stops: it neither coasts nor ends its plan
        moved = jnp.where(has_target, problem.stride * (last - memory.before), 0.0)
        start = _within_steps(problem, jnp.where(has_target, shifted, last))
        found = jax.lax.while_loop(
            lambda search: search.accepted < self.iterations + 2,
            lambda search: self._pass(problem, moved, search),
            self._begun(problem, start),
        )
        planned, at_knots = _split(found.evaluated)
        knots = HorizonMemory(found.best.knots, last)
        tips = at_knots.states[:, -1, POSITION]
        return Solution(planned, found.motion, knots, tips)

    def _begun(self, problem: Problem, knots: Knots) -> _Search:
        """Before the first pass; nothing is known but the shapes of all arrays."""
        last = problem.situation.last
        gradients = jnp.zeros((len(knots), last.bends.size))
        blocks = gradients[..., None] * gradients[:, None]
        nowhere = jnp.full_like(knots, jnp.nan)
        none = _Expansion(nowhere, jnp.asarray(jnp.inf), gradients, blocks)
        unknown = last._replace(
            states=jnp.zeros((len(last.bends), 6)),
            points=jnp.zeros((len(problem.situation.radii), 3)),
            extrapolation=jnp.zeros(()),
        )
        memories = _repeated(problem.memory, len(knots))
        evaluated = _repeated(unknown, 1 + len(knots))
        zero = jnp.zeros((), jnp.int32)
        start = zero, zero, last.bends, knots, memories, none, knots, none, none
        return _Search(*start, unknown, problem.motion, evaluated)

    def _pass(self, problem: Problem, moved: Bends, search: _Search) -> _Search:
        """Evaluate the knots, and accept them or a shorter step."""
        is_first = search.accepted == 0
        is_last = search.accepted == self.iterations + 1
        bends = problem.situation.last.bends
        memories = jax.lax.cond(
            is_first | is_last,
            lambda: memories_along(problem, search.knots),
            lambda: search.memories,
        )
        candidates, slopes = jax.vmap(problem.expanded_at)(
            jnp.concatenate([search.here[None], search.knots]),
            jax.tree.map(_prepended, problem.memory, memories),
        )
        here, _ = _split(candidates)
        last = select(is_first, here, search.last)
        known = problem.complete(last)
        expansion = self._expansion(known, moved, search.knots, candidates, slopes)

        beside_obstacles = (known.situation.goal.thresholds > 0.0).any()
        is_uphill = beside_obstacles & (expansion.cost > search.base.cost)
        is_full = search.rejected == 0
        is_cheaper = (expansion.cost < search.cheapest.cost) | (search.rejected == 1)
        cheapest = select(is_cheaper, expansion, search.cheapest)
        fits = is_first | is_last | (is_full & ~is_uphill)
        accepts = fits | (search.rejected == len(SHARES) - 1)
        chosen = select(fits, expansion, cheapest)
        base = select(accepts, chosen, search.base)
        excess = chosen.cost - search.best.cost
        is_better = accepts & ~is_first & ~is_last & (excess < ROUNDING * chosen.cost)
        best = select(is_better, chosen, search.best)

        accepted = search.accepted + accepts
        rejected = jnp.where(accepts, 0, search.rejected + 1)
        full = jax.lax.cond(
            accepts & (accepted <= self.iterations),
            lambda: self._stepped(known, base),
            lambda: search.full,
        )
        tried = base.knots + jnp.asarray(SHARES)[rejected] * (full - base.knots)
        next_bends = bends + (best.knots[0] - bends) / problem.stride
        planned = problem.within_limits(configurations_from_bends(next_bends))
        ends = accepted == self.iterations + 1
        return _Search(
            accepted=accepted,
            rejected=rejected,
            here=jnp.where(ends, bends_from_configurations(planned), bends),
            knots=jnp.where(ends, best.knots, tried),
            memories=memories,
            base=base,
            full=full,
            cheapest=cheapest,
            best=best,
            last=last,
            motion=known.motion,
            evaluated=candidates,
        )

    def _expansion(
        self,
        problem: Problem,
        moved: Bends,
        knots: Knots,
        candidates: Candidate,
        slopes: Candidate,
    ) -> _Expansion:
        """The cost of knots with these predictions, the first of which is beside them."""

        def terms(candidate: Candidate, slopes: Candidate, goal):
            later = problem._replace(situation=problem.situation._replace(goal=goal))
            directional = jax.vmap(
                lambda slope: jax.jvp(later.residuals, (candidate,), (slope,)),
                out_axes=(None, 1),
            )
            return directional(slopes)

        _, at_knots = _split(candidates)
        _, along = _split(slopes)
        values, jacobians = jax.vmap(terms)(at_knots, along, problem.ahead)
        roughness, rough = jax.value_and_grad(self._roughness)(knots, problem, moved)
        gradients = jnp.einsum("kri,kr->ki", jacobians, values)
        blocks = jnp.einsum("kri,krj->kij", jacobians, jacobians)
        damping = DAMPING + FAR_DAMPING * jnp.sum(values**2, axis=-1)
        return _Expansion(
            knots,
            jnp.sum(values**2) + roughness,
            gradients + rough.reshape(gradients.shape) / 2.0,
            blocks + damping[:, None, None] * jnp.eye(moved.size),
        )

    def _stepped(self, problem: Problem, base: _Expansion) -> Knots:
        """Knots after a full step, within the step limits."""
        change_weight = jnp.asarray(problem.situation.goal.change_weight)
        coupling = change_weight * self.coupling(base.gradients.shape[-1])
        step = minimum(base.blocks, base.gradients, coupling)
        return _within_steps(problem, base.knots + step.reshape(base.knots.shape))

    def _roughness(self, knots: Knots, problem: Problem, moved: Bends) -> Scalar:
        """Cost of changes of bends, and of changes of these changes.

        Args:
            knots: [rad].
            problem: of the control step.
            moved: by which the bends moved in the last interval [rad].
        """
        last = problem.situation.last.bends
        changes = jnp.diff(knots, axis=0, prepend=last[None])
        turns = jnp.diff(changes, axis=0, prepend=moved[None])
        squares = (self.change * changes) ** 2 + (self.acceleration * turns) ** 2
        return jnp.asarray(problem.situation.goal.change_weight) * jnp.sum(squares)

    def coupling(self, size: int) -> Float[Array, "triple triple"]:
        """Curvature of the costs of changes, of a knot and the two before it."""
        change = self.change * np.array([1.0, -1.0, 0.0])
        turn = self.acceleration * np.array([1.0, -2.0, 1.0])
        curvature = np.outer(change, change) + np.outer(turn, turn)
        return jnp.asarray(np.kron(curvature, np.eye(size)), dtype=jnp.float32)


def _repeated(row: Any, count: int) -> Any:
    """A pytree whose arrays have so many equal rows."""
    return jax.tree.map(lambda part: jnp.broadcast_to(part, (count, *part.shape)), row)


def _prepended(first: Array, others: Array) -> Array:
    return jnp.concatenate([first[None], others])


def _split(rows: Any) -> tuple[Any, Any]:
    """The first row of every array, and the others."""
    first = jax.tree.map(lambda part: part[0], rows)
    return first, jax.tree.map(lambda part: part[1:], rows)


def _within_steps(problem: Problem, knots: Knots) -> Knots:
    """The commanded part of knots, each within the step limit of the one before it."""
    longest = problem.stride * problem.situation.longest_step

    def follow(before: Bends, wanted: Bends) -> tuple[Bends, Bends]:
        allowed = before + limit_lengths(wanted - before, longest)
        return allowed, allowed

    first = problem.situation.last.bends
    return jax.lax.scan(follow, first, problem.commanded(knots))[1]


def memories_along(problem: Problem, knots: Knots) -> Memory:
    """Memories before the control step to every knot, of an arm that follows the plan.

    Args:
        problem: of the first control step.
        knots: of the plan [rad].

    Returns:
        With the knots as first axis.
    """
    stride = problem.stride

    def after(memory: Memory, bends: Bends) -> Memory:
        return problem.observe(configurations_from_bends(bends), memory)

    def follow(before: tuple[Memory, Bends], knot: Bends):
        memory, left = before

        def advance(step: Array, memory: Memory) -> Memory:
            return after(memory, left + (step + 1.0) / stride * (knot - left))

        arriving = jax.lax.fori_loop(0, stride - 1, advance, memory)
        return (after(arriving, knot), knot), arriving

    start = problem.memory, problem.situation.last.bends
    return jax.lax.scan(follow, start, knots)[1]


def minimum(
    blocks: Float[Array, "knots size size"],
    gradients: Float[Array, "knots size"],
    coupling: Float[Array, "triple triple"],
) -> Float[Array, "knots size"]:
    """Minimum of a quadratic function that couples each knot with the two before it.

    Dynamic programming: from the last knot on, each is expressed by the two before it
    (a block-banded Cholesky factorization). Time grows linearly with the knots.

    Args:
        blocks: curvature at every knot.
        gradients: at every knot, at zero.
        coupling: curvature of each knot (first) and the two before it; those before the
            first knot are zero.
    """
    size = blocks.shape[-1]

    def eliminate(later, knot):
        curvature, gradient = later
        block, own = knot
        matrix = coupling.at[: 2 * size, : 2 * size].add(curvature)
        matrix = matrix.at[:size, :size].add(block)
        vector = jnp.concatenate([gradient, jnp.zeros(size)]).at[:size].add(own)
        right = jnp.concatenate([matrix[:size, size:], vector[:size, None]], axis=1)
        gains = jnp.linalg.solve(matrix[:size, :size], right)
        rest = matrix[size:, size:] - matrix[size:, :size] @ gains[:, :-1]
        return (rest, vector[size:] - matrix[size:, :size] @ gains[:, -1]), gains

    none = jnp.zeros((2 * size, 2 * size)), jnp.zeros(2 * size)
    _, gains = jax.lax.scan(eliminate, none, (blocks, gradients), reverse=True)

    def follow(before, gain):
        step = -(gain[:, :-1] @ before + gain[:, -1])
        return jnp.concatenate([step, before[:size]]), step

    return jax.lax.scan(follow, jnp.zeros(2 * size), gains)[1]
