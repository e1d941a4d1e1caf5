"""A plan over a horizon: the bends of the next second, planned together.

Every control step shifts the last plan by one step and improves it by a few iterations
(the real-time iteration of Diehl, Bock and Schlöder, SIAM J. Control Optim. 43, 2005).
Each knot has the terms of the objective; changes of bends, and changes of these changes,
cost too, so plans are smooth, and a plan moves before its goal does.

Every iteration takes its damped step, also where it costs more than before: the slopes
are those of taut cables, which can point uphill inside a backlash, and a plan that waits
for a slope that points downhill stands still. Beside obstacles, such a step is shortened,
since iterations would go to and fro across their edges, beyond which the curvature is
another one (a line search with all steps side by side). Far from a goal the damping is
larger, since Gauss-Newton leaves out the curvature of what stays of the residual (Fan and
Yuan, Computing 74, 2005). The cheapest of the iterates is taken.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.goals import PREVIEW, Goal
from s2c2a.kinematics import configurations_from_bends, limit_lengths
from s2c2a.models.forward_model import Memory
from s2c2a.planning.solvers import Problem, Solver, linearize
from s2c2a.planning.terms import Bends, Configurations

Knots = Float[Array, "knots modules 2"]
# measured in docs/results/failed-experiments.md#a-horizon
DAMPING = 1e-2  # of squared slopes near one, since residuals are scaled
FAR_DAMPING = 0.1  # further damping, of the squared residual
SHARES = 0.5 ** np.arange(1.0, 4.0, dtype=np.float32)  # of a step beside obstacles


class HorizonMemory(NamedTuple):
    """What a horizon remembers.

    Attributes:
        knots: planned bends [rad].
        before: bends before the last step [rad].
    """

    knots: Knots
    before: Bends


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

    def start(self, bends: Bends) -> HorizonMemory:
        return HorizonMemory(jnp.tile(bends, (PREVIEW, 1, 1)), bends)

    def planned(self, memory: HorizonMemory) -> Knots:
        return memory.knots

    def solve(self, problem: Problem) -> Configurations:
        return self.next(problem, self.start(problem.situation.last.bends))[0]

    def next(
        self, problem: Problem, memory: HorizonMemory
    ) -> tuple[Configurations, HorizonMemory]:
        last = problem.situation.last.bends
        has_target = problem.situation.goal.has_target
        following = jnp.concatenate([memory.knots[1:], memory.knots[-1:]])
        shifted = memory.knots + (following - memory.knots) / problem.stride
        # an arm that has lost its target stops: it neither coasts nor ends its plan
        moved = jnp.where(has_target, problem.stride * (last - memory.before), 0.0)
        start = _within_steps(problem, jnp.where(has_target, shifted, last))
        memories = memories_along(
            problem.observe, problem.memory, last, start, problem.stride
        )
        course = _Course(problem, memories, moved, self)
        final, (iterates, costs) = jax.lax.scan(
            lambda knots, _: course.improved(knots), start, length=self.iterations
        )
        # each iteration but the first begins at an iterate, and knows its cost
        costs = jnp.append(costs[1:], course.cost(final))
        knots = iterates[jnp.argmin(costs)]
        bends = last + (knots[0] - last) / problem.stride
        return configurations_from_bends(bends), HorizonMemory(knots, last)

    def coupling(self, size: int) -> Float[Array, "triple triple"]:
        """Curvature of the costs of changes, of a knot and the two before it."""
        change = self.change * np.array([1.0, -1.0, 0.0])
        turn = self.acceleration * np.array([1.0, -2.0, 1.0])
        curvature = np.outer(change, change) + np.outer(turn, turn)
        return jnp.asarray(np.kron(curvature, np.eye(size)), dtype=jnp.float32)


class _Course(NamedTuple):
    """The cost of the knots, and an iteration that lowers it.

    Attributes:
        problem: of the control step.
        memories: of the forward model before every knot.
        moved: by which the bends moved in the last interval [rad].
        weights: of changes.
    """

    problem: Problem
    memories: Memory
    moved: Bends
    weights: Horizon

    def cost(self, knots: Knots) -> Float[Array, ""]:
        """The sum of squares of all terms, and of changes."""
        terms = jax.vmap(self._terms)(knots, self.problem.ahead, self.memories)
        return jnp.sum(terms**2) + self._roughness(knots)

    def improved(self, knots: Knots) -> tuple[Knots, tuple[Knots, Float[Array, ""]]]:
        """The knots after an iteration, the same again, and the cost before it."""
        size = self.moved.size
        values, slopes = jax.vmap(
            lambda bends, goal, memory: linearize(
                lambda at: self._terms(at, goal, memory), bends
            )
        )(knots, self.problem.ahead, self.memories)
        before = jnp.sum(values**2) + self._roughness(knots)
        gradients = jnp.einsum("kri,kr->ki", slopes, values)
        rough = jax.grad(self._roughness)(knots).reshape(gradients.shape)
        blocks = jnp.einsum("kri,krj->kij", slopes, slopes)
        damping = DAMPING + FAR_DAMPING * jnp.sum(values**2, axis=-1)
        damped = blocks + damping[:, None, None] * jnp.eye(size)
        coupling = self._change_weight * self.weights.coupling(size)
        step = minimum(damped, gradients + rough / 2.0, coupling)
        full = _within_steps(self.problem, knots + step.reshape(knots.shape))
        beside_obstacles = (self.problem.situation.goal.thresholds > 0.0).any()
        next_knots = jax.lax.cond(
            beside_obstacles & (self.cost(full) > before),
            lambda: self._shortened(knots, full),
            lambda: full,
        )
        return next_knots, (next_knots, before)

    def _shortened(self, knots: Knots, full: Knots) -> Knots:
        """The cheapest of several shares of a step."""
        tried = jax.vmap(lambda share: knots + share * (full - knots))(SHARES)
        return tried[jnp.argmin(jax.vmap(self.cost)(tried))]

    @property
    def _change_weight(self) -> Array:
        return jnp.asarray(self.problem.situation.goal.change_weight)

    def _terms(
        self, bends: Bends, goal: Goal, memory: Memory
    ) -> Float[Array, " residuals"]:
        return self.problem.later(goal, memory).stacked(bends)

    def _roughness(self, knots: Knots) -> Float[Array, ""]:
        """Cost of changes of bends, and of changes of these changes."""
        last = self.problem.situation.last.bends
        changes = jnp.diff(knots, axis=0, prepend=last[None])
        turns = jnp.diff(changes, axis=0, prepend=self.moved[None])
        squares = (self.weights.change * changes) ** 2
        squares += (self.weights.acceleration * turns) ** 2
        return self._change_weight * jnp.sum(squares)


def _within_steps(problem: Problem, knots: Knots) -> Knots:
    """The commanded part of knots, each within the step limit of the one before it."""
    longest = problem.stride * problem.situation.longest_step

    def follow(before: Bends, wanted: Bends) -> tuple[Bends, Bends]:
        allowed = before + limit_lengths(wanted - before, longest)
        return allowed, allowed

    first = problem.situation.last.bends
    return jax.lax.scan(follow, first, problem.commanded(knots))[1]


def memories_along(
    observe: Callable[[Configurations, Memory], Memory],
    memory: Memory,
    last: Bends,
    knots: Knots,
    stride: int,
) -> Memory:
    """Memories before the control step to every knot, of an arm that follows the plan.

    Args:
        observe: of the forward model.
        memory: before the first control step.
        last: bends before it [rad].
        knots: of the plan [rad].
        stride: control steps between two knots.

    Returns:
        With the knots as first axis.
    """

    def after(memory: Memory, bends: Bends) -> Memory:
        return observe(configurations_from_bends(bends), memory)

    def follow(before: tuple[Memory, Bends], knot: Bends):
        memory, left = before

        def advance(step: Array, memory: Memory) -> Memory:
            return after(memory, left + (step + 1.0) / stride * (knot - left))

        arriving = jax.lax.fori_loop(0, stride - 1, advance, memory)
        return (after(arriving, knot), knot), arriving

    return jax.lax.scan(follow, (memory, last), knots)[1]


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
