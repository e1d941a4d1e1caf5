"""Solvers: from a planning problem to configurations; also the reach of an arm.

The problem has few variables, two bends per module, and an expensive forward model.
Damped least squares evaluate all directions of the Jacobian side by side, and end
nearer to the optimum in a few iterations than gradient descent does in dozens.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TargetError
from s2c2a.execution.compilation import compiled, select
from s2c2a.goals import Goal
from s2c2a.kinematics import (
    bends_from_configurations,
    commanded_configurations,
    commanded_part,
    configurations_from_bends,
    limit_lengths,
    norm,
    states_from_bends,
)
from s2c2a.kinematics.bends import Scalar
from s2c2a.models.forward_model import Memory
from s2c2a.paper import minimize, unit_vectors
from s2c2a.planning.motion import GoalMotion
from s2c2a.planning.terms import (
    Bends,
    Candidate,
    Configurations,
    Residual,
    Situation,
    Term,
)
from s2c2a.plugins.components import Component
from s2c2a.spaces import POSITION

Variables = Float[Array, "*variables"]
ResidualVector = Float[Array, " residuals"]
Residuals = Callable[[Variables], ResidualVector]
Projection = Callable[[Variables], Variables]

INITIAL_DAMPING = 1e-2  # of squared slopes near one: residuals are scaled (`unit`)
DAMPING_AFTER_ACCEPTED = 0.2  # factor
DAMPING_AFTER_REJECTED = 10.0  # factor
DAMPING_RANGE = (1e-6, 1e4)
REACH_ITERATIONS = 30  # chosen: more than a plan has, from a start that is far away
ON_AXIS = 1e-3  # of the arm's length: a nearer point is on no side of the axis
REST_WEIGHT = 1e-3  # of bends beside positions; keeps solutions from drifting


class _Iterate(NamedTuple):
    """An accepted point, its sum of squares, and the normal equations there."""

    point: Variables
    cost: Scalar
    gradient: Float[Array, " variables"]
    curvature: Float[Array, "variables variables"]
    damping: Scalar


def solve_least_squares(
    residuals: Residuals, start: Variables, project: Projection, iterations: int
) -> tuple[Variables, Scalar]:
    """Minimize a sum of squared residuals by the Levenberg-Marquardt method.

    Each iteration solves (J^T J + lambda I) step = -J^T r, projects, and accepts the
    step only where the sum falls. lambda shrinks after an accepted step and grows after
    a rejected one.

    Args:
        residuals: variables -> residuals, differentiable.
        start: initial point of any shape; it is projected first.
        project: projection onto the feasible set; the identity if there is none.
        iterations: their number.

    Returns:
        The point, and the sum there.
    """
    identity = jnp.eye(start.size)

    def iterate(_: Array, current: _Iterate) -> _Iterate:
        damped = current.curvature + current.damping * identity
        step = jnp.linalg.solve(damped, current.gradient)
        point = project(current.point - step.reshape(start.shape))
        values, jacobian = along_axes(residuals, point, 1)
        cost = jnp.sum(values**2)
        accepted = cost < current.cost
        factor = jnp.where(accepted, DAMPING_AFTER_ACCEPTED, DAMPING_AFTER_REJECTED)
        damping = jnp.clip(current.damping * factor, *DAMPING_RANGE)
        trial = _Iterate(
            point, cost, jacobian.T @ values, jacobian.T @ jacobian, damping
        )
        return select(accepted, trial, current)._replace(damping=damping)

    # The first iteration makes no step and evaluates the start, so that the model is
    # compiled into the program once, not twice.
    initial = _Iterate(
        start,
        jnp.asarray(jnp.inf),
        jnp.zeros(start.size),
        jnp.zeros_like(identity),
        jnp.asarray(INITIAL_DAMPING / DAMPING_AFTER_ACCEPTED),
    )
    final = jax.lax.fori_loop(0, iterations + 1, iterate, initial)
    return final.point, final.cost


def along_axes(function: Callable[..., Any], point: Array, axis: int) -> Any:
    """Values at a point, and their slopes along all directions, side by side.

    Args:
        function: from the point to a pytree of arrays.
        point: of any shape.
        axis: of the directions in the slopes.
    """

    def directional_derivative(direction):
        return jax.jvp(function, (point,), (direction.reshape(point.shape),))

    directions = jnp.eye(point.size)
    return jax.vmap(directional_derivative, out_axes=(None, axis))(directions)


class Problem(NamedTuple):
    """The optimization problem of a control step, in both forms that solvers need.

    Attributes:
        situation: what is fixed; `situation.last` is the starting point.
        terms: of the objective.
        predict: (configurations, the same as bends, memory) -> a candidate with its
            prediction.
        observe: (configurations, memory) -> memory after the arm has been there.
        memory: of the forward model, before the next step.
        stride: control steps between two moments of a preview.
        motion: of the goals so far.
        complete: last plan with its prediction -> the whole problem.
        ahead: goals of the next moments (`goals.Goal.preview`), with these as first axis;
            None before the last plan is predicted.
    """

    situation: Situation
    terms: tuple[Term, ...]
    predict: Callable[[Configurations, Bends, Memory], Candidate]
    observe: Callable[[Configurations, Memory], Memory]
    memory: Memory
    stride: int
    motion: GoalMotion
    complete: Callable[[Candidate], "Problem"]
    ahead: Goal | None = None

    def started(self) -> "Problem":
        """The whole problem, after a prediction of the last plan."""
        last = self.situation.last
        return self.complete(self.predict(last.configurations, last.bends, self.memory))

    def sum_of_norms(self, configurations: Configurations) -> Scalar:
        """The sum over all groups of mu |r| (Chen et al. 2025, eq. (7))."""
        bends = bends_from_configurations(configurations)
        total = jnp.zeros(())
        candidate = self.predict(configurations, bends, self.memory)
        for weights, residuals in self._weighted(candidate):
            total = total + jnp.sum(weights * norm(residuals))
        return total

    def stacked(self, bends: Bends) -> ResidualVector:
        """The residuals of these bends."""
        return self.residuals(self.candidate_at(bends, self.memory))

    def residuals(self, candidate: Candidate) -> ResidualVector:
        """All sqrt(mu) r in one vector; its sum of squares is the sum of mu |r|^2."""
        rows = []
        for weights, residuals in self._weighted(candidate):
            scale = jnp.sqrt(jnp.asarray(weights))[..., None]
            rows.append((scale * residuals).reshape(-1))
        return jnp.concatenate(rows)

    def candidate_at(self, bends: Bends, memory: Memory) -> Candidate:
        """The candidate with these bends."""
        return self.predict(configurations_from_bends(bends), bends, memory)

    def expanded_at(self, bends: Bends, memory: Memory) -> tuple[Candidate, Candidate]:
        """The candidate with these bends, and its slopes; their first axis are the bends."""
        return along_axes(lambda each: self.candidate_at(each, memory), bends, 0)

    def within_limits(self, desired: Configurations) -> Configurations:
        """Configurations within the bend limits and one step limit from the last ones.

        The angle between two configurations is never larger than the distance of their
        bends. Vectors that are not of unit length have no bend limits.
        """
        situation = self.situation
        if not situation.on_sphere:
            last = situation.last.configurations
            changes = self.projected(desired) - last
            return last + limit_lengths(changes, situation.longest_step)
        bends = bends_from_configurations(desired)
        allowed = limit_lengths(bends, situation.bend_limits)
        return configurations_from_bends(self.within_step(allowed))

    def within_step(self, bends: Bends) -> Bends:
        """Bends that cables command, at most one step limit from the last ones."""
        last = self.situation.last.bends
        changes = self.commanded(bends) - last
        return last + limit_lengths(changes, self.situation.longest_step)

    def commanded(self, bends: Bends) -> Bends:
        """The part of bends that cables command.

        The objective does not depend on the other part, so iterates would go anywhere
        in it by rounding errors, and step limits shorten both parts together.
        """
        return commanded_part(bends, self.situation.steerable)

    def projected(self, configurations: Configurations) -> Configurations:
        """Configurations that cables command, of unit length where they are kept so."""
        situation = self.situation
        if situation.steerable is not None:
            configurations = commanded_configurations(
                configurations, situation.steerable
            )
        return unit_vectors(configurations) if situation.on_sphere else configurations

    def _weighted(self, candidate: Candidate) -> list[Residual]:
        return [term.residual(candidate, self.situation) for term in self.terms]


class Solution(NamedTuple):
    """What a solver plans in a control step.

    Attributes:
        planned: the next configurations within the limits, and their prediction.
        motion: of the goals, after this step.
        memory: of the solver, for the next control step.
        tips: positions of the tip in the next moments [m], base frame; None unless the
            solver looks ahead.
    """

    planned: Candidate
    motion: GoalMotion
    memory: Any
    tips: Float[Array, "moments 3"] | None


@dataclass(frozen=True)
class Solver(Component, ABC):
    """Finds the next configurations; traced by JAX, so no branches on values.

    A solver with a memory also overrides `start` and `next`.

    Attributes:
        looks_ahead: whether its solutions have the tips of the next moments.
    """

    looks_ahead: ClassVar[bool] = False

    @abstractmethod
    def solve(self, problem: Problem) -> Configurations:
        """Configurations of a low objective, shape (modules, 3), module frames."""

    def start(self, bends: Bends) -> Any:
        """The memory at rest, a pytree: nothing unless a subclass overrides it.

        Args:
            bends: of the arm at rest [rad], shape (modules, 2).
        """
        return None

    def next(self, problem: Problem, memory: Any) -> Solution:
        """The configurations of `solve` within the limits.

        Args:
            problem: before the last plan is predicted (`Problem.started`).
            memory: of the last control step.
        """
        whole = problem.started()
        planned = whole.within_limits(self.solve(whole))
        bends = bends_from_configurations(planned)
        predicted = whole.predict(planned, bends, whole.memory)
        return Solution(predicted, whole.motion, memory, None)


@dataclass(frozen=True)
class Adam(Solver):
    """Adam on the sum of norms, from the last configuration.

    The defaults are those of Chen et al. 2025, sec. III-A. Where configurations are of
    unit length, each module's vector is normalized after every iteration.

    Attributes:
        learning_rate: of Adam.
        iterations: in a control step.
    """

    learning_rate: float = 0.02
    iterations: int = 10

    def solve(self, problem: Problem) -> Configurations:
        return minimize(
            problem.sum_of_norms,
            problem.situation.last.configurations,
            problem.projected,
            self.learning_rate,
            self.iterations,
        )


def reach_gaps(
    arm: ArmSpec, positions: Float[np.ndarray, "points 3"], module: int = -1
) -> Float[np.ndarray, " points"]:
    """Distance from desired positions to the nearest reachable position of ideal arcs.

    The arm is modeled as constant-curvature arcs within its bend limits, without
    gravity, hysteresis or payload, and no trained model is used. Near the edge of its
    workspace, a real arm can miss positions by centimeters that arcs reach;
    `plan_error` is the distance by the planner's own model.

    Args:
        arm: the arm.
        positions: desired positions [m], base frame.
        module: number of the module whose end is meant.

    Returns:
        Distances [m], shape (points,).

    Raises:
        TargetError: there is no such module.
    """
    count = arm.module_count
    if not -count <= module < count:
        raise TargetError(
            f"module {module} does not exist; '{arm.name}' has {count}, from 0 at the "
            f"base to {count - 1}, or -1 for the last one"
        )
    used = range(count)[module] + 1
    geometry = ArmGeometry.of(arm)
    lengths = jnp.asarray(geometry.lengths[:used], dtype=jnp.float32)
    limits = jnp.asarray(geometry.bend_limits[:used], dtype=jnp.float32)
    projectors = None if geometry.steerable is None else geometry.steerable[:used]
    # few programs serve all numbers of positions
    padded = np.resize(positions, (1 << len(positions).bit_length(), 3))
    inputs = np.asarray(padded, np.float32), lengths, limits, projectors
    return np.asarray(compiled(_gaps)(*inputs))[: len(positions)]


def _gaps(positions, lengths, limits, projectors):
    size = jnp.sum(lengths)

    def end_of(bends):
        steered = commanded_part(bends, projectors)
        return states_from_bends(steered, lengths)[-1, POSITION]

    def project(bends):
        return limit_lengths(bends, limits)

    def gap_from(start, position):
        def residuals(bends):
            error = (end_of(bends) - position) / size
            return jnp.concatenate([error, REST_WEIGHT * bends.reshape(-1)])

        bends, _ = solve_least_squares(residuals, start, project, REACH_ITERATIONS)
        return jnp.linalg.norm(end_of(bends) - position)

    def gap(position):
        # shapes that bend towards a position: all modules alike, or the lower half
        # alone
        radius = jnp.linalg.norm(position[:2])
        direction = position[:2] / jnp.maximum(radius, ON_AXIS * size)
        direction = jnp.where(radius > ON_AXIS * size, direction, jnp.eye(2)[0])
        alike = 0.5 * limits[:, None] * direction
        is_lower = jnp.arange(len(limits)) < len(limits) / 2
        lower = alike * is_lower[:, None] * 2.0
        starts = jnp.stack([alike, lower, 0.1 * alike])
        return jax.vmap(lambda start: gap_from(start, position))(starts).min()

    return jax.vmap(gap)(positions)
