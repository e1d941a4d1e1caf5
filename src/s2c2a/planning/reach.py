"""Reachability: how closely an arm at rest reaches its targets, and by which shapes.

A table holds shapes that are spread over all bends within the limits. The shape of each
of its parts that is nearest to the targets is a start, from which least squares on the
forward model lead to the nearest shape.
"""

from collections.abc import Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import directions_at
from s2c2a.arm.spec import warn_of_payload
from s2c2a.errors import TargetError
from s2c2a.execution.compilation import compiled
from s2c2a.goals import MAX_OBSTACLES, Goal
from s2c2a.kinematics import (
    commanded_part,
    configurations_from_bends,
    limit_lengths,
    norm,
)
from s2c2a.kinematics.bends import Scalar, Values
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel, Memory, PCCForwardModel
from s2c2a.obstacles import distances
from s2c2a.planning.outcomes import SIGNIFICANT
from s2c2a.planning.solvers import ResidualVector, solve_least_squares
from s2c2a.planning.terms import Bends, Guard, GuardedPoints
from s2c2a.printing import short_text
from s2c2a.spaces import AXIS, POSITION

# chosen; tests/planning/test_reach.py compares them with a long search
SHAPES = 2**13  # of the table
STARTS = 8
BESIDE = 16  # shapes of each part that may be a start beside obstacles
ITERATIONS = 20
CHUNK = 32  # targets in a call
BATCH = 256  # shapes predicted at once: more take memory, not less time
FEW_OBSTACLES = 8  # as quick as one
AXIS_LENGTH = 0.1  # of the arm's length: it costs as much as an axis turned by 1 rad
EVENNESS = 3e-4  # weight of differences between bends: shapes do not drift
DEPTH_WEIGHT = 20.0  # of depths in obstacles, beside distances
ALIKE = 2e-3  # of the arm's length: starts that end within it lead as near

States = Float[Array, "modules 6"]
PerModule = Float[np.ndarray, " modules"]
PerTarget = Float[np.ndarray, " targets"]


class Reached(NamedTuple):
    """The shapes that are nearest to targets, in equilibrium.

    Attributes:
        bends: of the arm [rad], shape (targets, modules, 2), module frames.
        states: predicted [m, 1], shape (targets, modules, 6), base frame.
        position_errors: largest distance of a module's end from its target [m], shape
            (targets,).
        axis_errors: largest angle between an end's axis and its target [rad], shape
            (targets,).
        clearances: distance of the guarded points from the obstacles [m]; infinite without
            any, shape (targets,).
        predictive_std: of the tip [m]; zero if the model does not know it, shape
            (targets,).
        agreeing: share of the starts that lead as near, shape (targets,).
    """

    bends: Float[np.ndarray, "targets modules 2"]
    states: Float[np.ndarray, "targets modules 6"]
    position_errors: PerTarget
    axis_errors: PerTarget
    clearances: PerTarget
    predictive_std: PerTarget
    agreeing: PerTarget

    def __repr__(self) -> str:
        """Fields, and shapes of arrays."""
        return short_text(self)

    def within(self, length: float) -> Bool[np.ndarray, " targets"]:
        """Whether targets are missed by less than is significant (`SIGNIFICANT`).

        An axis is missed where it is turned by an angle that costs as much.

        Args:
            length: of the arm [m].
        """
        is_near = self.position_errors <= SIGNIFICANT * length
        is_aligned = self.axis_errors <= SIGNIFICANT / AXIS_LENGTH
        is_clear = self.clearances >= -ALIKE * length
        return is_near & is_aligned & is_clear


class RestingArm(NamedTuple):
    """An arm at rest, as its forward model predicts it.

    Attributes:
        model: predicts states.
        lengths: of the modules [m].
        limits: of their bends as sensed (`ArmGeometry.planned_bends`) [rad]; arcs have
            no lost motion, and take the true ones.
        payload: at the tip [kg]; None for none.
        steerable: see `ArmGeometry`.
    """

    model: ForwardModel
    lengths: PerModule
    limits: PerModule
    payload: Float[np.ndarray, ""] | None
    steerable: Float[np.ndarray, "modules 2 2"] | None

    @classmethod
    def of(
        cls, arm: ArmSpec, model: ForwardModel, payload: float = 0.0
    ) -> "RestingArm":
        """The arm of an arm file with a payload [kg]."""
        geometry = ArmGeometry.of(arm)
        lengths = np.asarray(geometry.lengths, np.float32)
        are_arcs = isinstance(model, PCCForwardModel)
        limits = geometry.bend_limits if are_arcs else geometry.planned_bends
        is_loaded = model.takes_payload and payload > 0.0
        load = np.asarray(payload, np.float32) if is_loaded else None
        limits = np.asarray(limits, np.float32)
        return cls(model, lengths, limits, load, geometry.steerable)

    def within_limits(self, bends: Bends) -> Bends:
        """Bends that the cables command, within the limits."""
        return limit_lengths(commanded_part(bends, self.steerable), self.limits)

    def states(self, bends: Bends) -> States:
        """States of a shape [m, 1], base frame."""
        commanded = commanded_part(bends, self.steerable)
        configurations = configurations_from_bends(commanded)
        memory = self.model.start(configurations)
        loaded = self._loaded(configurations, memory)
        return self.model.predict(configurations, memory, loaded)

    def predictive_std(self, bends: Bends) -> Scalar:
        """Standard deviation of the tip [m]."""
        configurations = configurations_from_bends(bends)
        memory = self.model.start(configurations)
        return self.model.predictive_std(configurations, memory)[-1]

    def _loaded(self, configurations: Array, memory: Memory) -> Disturbances | None:
        """The payload with its moments, which solvers take as constant."""
        if self.payload is None:
            return None
        none = Disturbances.none(len(configurations))
        payload = none._replace(payload=jnp.asarray(self.payload))
        loaded = self.model.settled(payload, configurations, memory)
        return jax.lax.stop_gradient(loaded)


class Solutions(NamedTuple):
    """Shapes to which several starts lead.

    Attributes:
        bends: [rad], shape (starts, modules, 2), module frames.
        misses: distances from the target, in which axes count too [m].
    """

    bends: Float[np.ndarray, "starts modules 2"]
    misses: Float[np.ndarray, " starts"]


class Shapes(NamedTuple):
    """A table of shapes, spread over all bends within the limits.

    Attributes:
        bends: [rad], shape (shapes, modules, 2).
        states: [m, 1], shape (shapes, modules, 6), base frame.
    """

    bends: Float[Array, "shapes modules 2"]
    states: Float[Array, "shapes modules 6"]


class Reachability:
    """How closely an arm at rest reaches targets, by its forward model.

    Attributes:
        shapes: the table.
        states_of: from any number of bends [rad] to the states of these shapes.
    """

    def __init__(
        self,
        arm: ArmSpec,
        model: ForwardModel,
        payload: float = 0.0,
        guard: Guard = "arm",
    ):
        """Predict the table of shapes.

        Args:
            arm: its bend limits hold.
            model: predicts states.
            payload: at the tip [kg].
            guard: the points that keep clear of obstacles.
        """
        points_of = GuardedPoints.of(arm, guard)
        warn_of_payload(payload, arm)
        resting = RestingArm.of(arm, model, payload)
        spread = spread_bends(resting.limits, SHAPES)
        bends = np.asarray(commanded_part(spread, resting.steerable))
        self.states_of = compiled(_states_of, resting)
        self.shapes = Shapes(jnp.asarray(bends), self.states_of(bends))
        self._nearest = compiled(_nearest, resting, points_of, self.shapes)
        self._solutions = compiled(
            _solutions, resting, points_of, self.shapes, 4 * STARTS
        )

    def nearest(self, goals: Goal) -> Reached:
        """The nearest shapes of goals with positions, axes and obstacles.

        Args:
            goals: with the targets as first axis (`Goal.stacked`).

        Raises:
            TargetError: a goal has no target.
        """
        if not goals.has_target.all():
            raise TargetError(
                "a goal without a position or an axis is always reached; give one"
            )
        count = len(goals.positions)
        chunks = map(self._nearest, _chunks(goals))
        joined = jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *chunks)
        return Reached(**joined)

    def solutions(self, goal: Goal) -> Solutions:
        """The shapes to which several starts lead, for one goal."""
        goals = Goal(*(np.asarray(values)[None] for values in goal))
        (chunk,) = _chunks(goals, 1)
        found, misses = self._solutions(Goal(*(values[0] for values in chunk)))
        return Solutions(np.asarray(found), np.asarray(misses))


def spread_bends(limits: PerModule, count: int) -> Float[np.ndarray, "count modules 2"]:
    """Bends [rad] that fill the discs within the limits evenly.

    They are an additive recurrence with powers of a generalized golden ratio (Roberts,
    "The unreasonable effectiveness of quasirandom sequences", 2018).
    """
    axes = 2 * len(limits)
    ratio = 2.0
    for _ in range(60):
        ratio = (1.0 + ratio) ** (1.0 / (axes + 1.0))
    slopes = ratio ** -np.arange(1.0, axes + 1.0)
    places = (0.5 + np.arange(1, count + 1)[:, None] * slopes) % 1.0
    shares, turns = np.moveaxis(places.reshape(count, -1, 2), -1, 0)
    sizes = limits * np.sqrt(shares)
    bends = sizes[..., None] * directions_at(2.0 * np.pi * turns)
    return bends.astype(np.float32)


def obstacle_rows(used: int) -> int:
    """Rows for so many obstacles: few, or all; each number compiles once."""
    return FEW_OBSTACLES if used <= FEW_OBSTACLES else MAX_OBSTACLES


def _chunks(goals: Goal, size: int = CHUNK) -> Iterator[Goal]:
    """Goals in calls of one size, with the obstacles in use alone."""
    count = len(goals.positions)
    used = int((np.asarray(goals.thresholds) > 0.0).any(axis=0).sum())
    padded = obstacle_rows(used) if used else 0
    order = np.argsort(np.asarray(goals.thresholds).max(axis=0) <= 0.0, kind="stable")
    goals = goals.with_rows(order[:padded])
    for begin in range(0, count, size):
        numbers = np.minimum(np.arange(begin, begin + size), count - 1)
        yield Goal(*(np.asarray(values)[numbers] for values in goals))


def _states_of(
    arm: RestingArm, bends: Float[Array, "shapes modules 2"]
) -> Float[Array, "shapes modules 6"]:
    return jax.lax.map(arm.states, bends, batch_size=BATCH)


def _nearest(
    arm: RestingArm, points_of: GuardedPoints, shapes: Shapes, goals: Goal
) -> dict[str, Array]:
    """The fields of `Reached` for a chunk of goals."""

    def nearest(goal: Goal) -> dict[str, Array]:
        length = jnp.sum(jnp.asarray(arm.lengths))
        found, misses = _solutions(arm, points_of, shapes, STARTS, goal)
        bends = found[jnp.argmin(misses)]
        states = arm.states(bends)
        ends = norm(states[:, POSITION] - goal.positions)
        cosines = jnp.sum(states[:, AXIS] * goal.axes, axis=-1)
        angles = jnp.arccos(jnp.clip(cosines, -1.0, 1.0))
        has_position = jnp.asarray(goal.position_weights) > 0.0
        has_axis = jnp.asarray(goal.axis_weights) > 0.0
        clearances = _clearances(points_of, states, goal)
        return {
            "bends": bends,
            "states": states,
            "position_errors": jnp.max(jnp.where(has_position, ends, 0.0)),
            "axis_errors": jnp.max(jnp.where(has_axis, angles, 0.0)),
            "clearances": jnp.min(clearances, initial=jnp.inf),
            "predictive_std": arm.predictive_std(bends),
            "agreeing": jnp.mean(misses <= jnp.min(misses) + ALIKE * length),
        }

    return jax.vmap(nearest)(goals)


def _solutions(
    arm: RestingArm, points_of: GuardedPoints, shapes: Shapes, count: int, goal: Goal
) -> tuple[Float[Array, "starts modules 2"], Float[Array, " starts"]]:
    """Shapes from several starts, and their distances from the target [m]."""
    length = jnp.sum(jnp.asarray(arm.lengths))

    def errors(states: States) -> ResidualVector:
        """Of the target and of the obstacles, in parts of the arm's length."""
        clearances = _clearances(points_of, states, goal)
        depths = jnp.maximum(-clearances, 0.0) / length
        aims = _target_errors(states, goal, length)
        return jnp.concatenate([aims, DEPTH_WEIGHT * depths])

    aims = jax.vmap(lambda states: _target_errors(states, goal, length))
    squares = aims(shapes.states) ** 2
    misses = jnp.sum(squares, axis=-1).reshape(count, -1)
    beside = BESIDE if goal.thresholds.size else 1
    _, nearest = jax.lax.top_k(-misses, beside)
    numbers = jnp.arange(count)
    rows = (numbers * misses.shape[1])[:, None] + nearest
    every = jax.vmap(jax.vmap(errors))
    costs = jnp.sum(every(shapes.states[rows]) ** 2, axis=-1)
    best = jnp.argmin(costs, axis=1)
    starts = shapes.bends[rows[numbers, best]]

    def residuals(bends: Bends) -> ResidualVector:
        even = EVENNESS * jnp.diff(bends, axis=0).reshape(-1)
        return jnp.concatenate([errors(arm.states(bends)), even])

    def solved(start: Bends) -> tuple[Bends, Scalar]:
        return solve_least_squares(residuals, start, arm.within_limits, ITERATIONS)

    found, costs = jax.vmap(solved)(starts)
    return found, jnp.sqrt(costs) * length


def _target_errors(states: States, goal: Goal, length: Scalar) -> ResidualVector:
    """Errors of all ends and axes that have a target, in parts of the arm's length."""
    positions = (states[:, POSITION] - goal.positions) / length
    axes = AXIS_LENGTH * (states[:, AXIS] - goal.axes)
    desired = jnp.stack([goal.position_weights, goal.axis_weights])[..., None] > 0.0
    return jnp.where(desired, jnp.stack([positions, axes]), 0.0).reshape(-1)


def _clearances(
    points_of: GuardedPoints, states: States, goal: Goal
) -> Float[Array, " points"]:
    """Distances of the guarded points from the union of the obstacles [m].

    They are infinite without obstacles. Only the obstacle that is nearest to a point is
    differentiated.
    """
    points = points_of(states)
    if not goal.thresholds.size:
        return jnp.full(len(points), jnp.inf)
    nearest = jnp.argmin(_gaps(jax.lax.stop_gradient(points)[:, None], goal), axis=1)
    return _gaps(points, goal.with_rows(nearest)) - points_of.radii


def _gaps(points: Float[Array, "*batch 3"], goal: Goal) -> Values:
    """Distances from obstacles [m]; infinite from unused rows."""
    gaps = distances(points, goal.obstacles, goal.cores) - goal.thresholds
    return jnp.where(goal.thresholds > 0.0, gaps, jnp.inf)
