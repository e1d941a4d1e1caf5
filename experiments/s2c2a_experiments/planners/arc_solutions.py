"""Shapes of ideal arcs that reach goals, solved from many starts at once.

Damped least squares on the arcs (`s2c2a.planning.solvers`) lead from every start to the
nearest shape that reaches the targets and keeps the guarded points out of obstacles.
"""

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import commanded_part, limit_lengths, states_from_bends
from s2c2a.obstacles import distances
from s2c2a.planning.reach import PerModule, spread_bends
from s2c2a.planning.solvers import solve_least_squares
from s2c2a.planning.terms import Guard, GuardedPoints
from s2c2a.spaces import AXIS, POSITION
from s2c2a_experiments.planners.arc_driver import TINY, Bends

UNIT = 0.4  # of the arm's length; as `planning.terms.Positions`
PULL = 0.01  # [1/rad]; toward a solution's start: redundant bends stay
PUSHES = 5  # out of obstacles, in a step
DEPTH_WEIGHT = 20.0  # as `planning.terms.Obstacles`
WAY_POINTS = 8  # checked on the way to a solution: a step limit or two apart

Batch = Float[np.ndarray, "solutions modules 2"]
Values = Float[np.ndarray, " solutions"]


class SolvedShapes(NamedTuple):
    """Shapes that are near their starts.

    Attributes:
        bends: [rad], shape (solutions, modules, 2), module frames.
        errors: of the targets, in units of `UNIT`, shape (solutions,).
    """

    bends: Batch
    errors: Values


class ObstacleScene(NamedTuple):
    """A goal whose first `used` rows of obstacles are in use."""

    goal: Goal
    used: Int[np.ndarray, ""]


class ArcSolutions:
    """Solves goals on the ideal arcs of one arm.

    Attributes:
        length: of the arm [m].
        limits: largest planned bends [rad], shape (modules,).
        step_limit: largest change of a module's bend in a step [rad].
    """

    def __init__(self, arm: ArmSpec, guard: Guard, margin: float, iterations: int = 10):
        """Compile nothing yet: see `warm_up`.

        Args:
            arm: whose arcs.
            guard: points that keep clear of obstacles.
            margin: that they keep beyond thresholds, in parts of the arm's length.
            iterations: of a solution.
        """
        geometry = ArmGeometry.of(arm)
        self.length = arm.length
        self.limits = geometry.planned_bends.astype(np.float32)
        self.step_limit = geometry.step_limit
        self.margin = margin * arm.length
        self._steerable = geometry.steerable
        self._points = GuardedPoints.of(arm, guard)
        self._lengths = geometry.lengths.astype(np.float32)
        self._iterations = iterations
        self._solve = jax.jit(self._solutions)
        self._pushed = jax.jit(self._pushed_outside)
        clearances = jax.vmap(self._clearance, (0, None))
        self._clearances = jax.jit(clearances)

    def warm_up(self, solved: int, checked: int) -> None:
        """Compile for so many starts, and so many shapes whose clearance is asked."""
        modules = len(self.limits)
        center = np.ones((1, 3))
        radius = np.full(1, 1e-3)
        goal = Goal.of(modules).with_obstacles(center, radius)
        count = max(solved, checked)
        shapes = np.zeros((count, modules, 2), np.float32)
        self.solve(shapes[:solved], goal)
        self.clearances(shapes[:checked], goal)
        self.outside(shapes[0], goal)

    def spread(self, count: int) -> Batch:
        """Shapes that fill the limits evenly."""
        spread = spread_bends(self.limits, count)
        return np.asarray(commanded_part(spread, self._steerable))

    def solve(
        self,
        starts: Batch,
        goal: Goal,
        moves: PerModule | None = None,
        targets: Float[np.ndarray, "solutions modules 6"] | None = None,
    ) -> SolvedShapes:
        """The solutions nearest to their starts.

        Args:
            starts: [rad].
            goal: with its targets and obstacles.
            moves: one for modules that move, zero for those that stay; all by default.
            targets: of every start, if not those of the goal [m, 1], base frame.
        """
        if moves is None:
            moves = np.ones(len(self.limits), np.float32)
        if targets is None:
            targets = np.concatenate([goal.positions, goal.axes], axis=-1)
        shape = len(starts), *targets.shape[-2:]
        targets = _float32(np.broadcast_to(targets, shape))
        starts = _float32(starts)
        bends, errors = self._solve(starts, targets, _in_use(goal), moves)
        return SolvedShapes(np.asarray(bends), np.asarray(errors))

    def clearances(self, shapes: Batch, goal: Goal) -> Values:
        """Least distances of the guarded points from obstacles [m]; infinite without."""
        gaps = self._clearances(_float32(shapes), _in_use(goal))
        return np.asarray(gaps)

    def way_clearances(
        self,
        starts: Float[np.ndarray, "*#solutions modules 2"],
        ends: Batch,
        goal: Goal,
        points: int = WAY_POINTS,
    ) -> Values:
        """Least clearances on the straight ways to ends [m], without their starts.

        Args:
            starts: [rad].
            ends: [rad].
            goal: with its obstacles.
            points: that are checked on a way.
        """
        if not len(goal.obstacles_in_use()):
            return np.full(len(ends), np.inf)
        shares = np.arange(1, points + 1) / points
        shares = shares[:, None, None, None]  # (points, solutions, modules, 2)
        ways = starts + shares * (ends - starts)
        shapes = ways.reshape(-1, *ends.shape[1:])
        gaps = self.clearances(shapes, goal)
        gaps = gaps.reshape(points, -1)
        return gaps.min(axis=0)

    def outside(self, shape: Bends, goal: Goal) -> Bends:
        """The nearest shape outside of obstacles."""
        if not len(goal.obstacles_in_use()):
            return shape
        pushed = self._pushed(_float32(shape), _in_use(goal))
        return np.asarray(pushed)

    def step(
        self,
        last: Bends,
        wanted: Bends,
        share: float,
    ) -> Bends:
        """A step straight to wanted bends, all modules in time with each other.

        Args:
            last: [rad].
            wanted: [rad].
            share: of the step limit that the fastest module uses.
        """
        change = wanted - last
        sizes = np.linalg.norm(change, axis=-1)
        largest = max(float(sizes.max()), TINY)
        part = share * self.step_limit / largest
        return last + min(1.0, part) * change

    def _solutions(
        self, starts: Array, targets: Array, scene: ObstacleScene, moves: Array
    ) -> tuple[Array, Array]:
        solve = jax.vmap(self._solution, (0, 0, None, None))
        return solve(starts, targets, scene, moves)

    def _solution(
        self, start: Array, targets: Array, scene: ObstacleScene, moves: Array
    ) -> tuple[Array, Array]:
        parts: Any = {"positions": targets[:, POSITION], "axes": targets[:, AXIS]}
        goal = scene.goal._replace(**parts)
        scene = scene._replace(goal=goal)
        within = partial(self._within_limits, start, moves)
        residuals = partial(self._residuals, start, scene, moves)
        first = within(start)
        found, _ = solve_least_squares(residuals, first, within, self._iterations)
        states = states_from_bends(found, self._lengths)
        errors = self._errors(states, goal)
        return found, jnp.linalg.norm(errors)

    def _pushed_outside(self, shape: Array, scene: ObstacleScene) -> Array:
        """Newton steps along the gradient of the least clearance."""
        clearance_and_slope = jax.value_and_grad(self._clearance)

        def push(_: int, bends: Array) -> Array:
            gap, slope = clearance_and_slope(bends, scene)
            depth = jnp.maximum(self.margin - gap, 0.0)
            steepness = jnp.sum(slope**2) + TINY
            pushed = bends + depth * slope / steepness
            commanded = commanded_part(pushed, self._steerable)
            return limit_lengths(commanded, self.limits)

        return jax.lax.fori_loop(0, PUSHES, push, shape)

    def _within_limits(self, start: Array, moves: Array, bends: Array) -> Array:
        moved = self._moved(start, moves, bends)
        return limit_lengths(moved, self.limits)

    def _moved(self, start: Array, moves: Array, bends: Array) -> Array:
        is_moving = moves[:, None] > 0.0
        moved = jnp.where(is_moving, bends, start)
        return commanded_part(moved, self._steerable)

    def _residuals(
        self, start: Array, scene: ObstacleScene, moves: Array, bends: Array
    ) -> Array:
        bends = self._moved(start, moves, bends)
        states = states_from_bends(bends, self._lengths)
        errors = self._errors(states, scene.goal)
        changes = (bends - start).reshape(-1)
        gaps = self._gaps(states, scene)
        depths = jnp.maximum(self.margin - gaps, 0.0)
        weighted = DEPTH_WEIGHT * depths / (UNIT * self.length)
        return jnp.concatenate([errors, PULL * changes, weighted])

    def _errors(self, states: Array, goal: Goal) -> Array:
        misses = states[:, POSITION] - goal.positions
        positions = misses / (UNIT * self.length)
        axes = states[:, AXIS] - goal.axes
        errors = jnp.stack([positions, axes])
        squared = jnp.stack([goal.position_weights, goal.axis_weights])
        weights = jnp.sqrt(squared)[..., None]
        weighted = weights * errors
        return weighted.reshape(-1)

    def _clearance(self, bends: Array, scene: ObstacleScene) -> Array:
        states = states_from_bends(bends, self._lengths)
        gaps = self._gaps(states, scene)
        return gaps.min()

    def _gaps(self, states: Array, scene: ObstacleScene) -> Array:
        """Distances of the guarded points from the nearest obstacles [m]."""
        points = self._points(states)
        fixed = jax.lax.stop_gradient(points)
        nearest = _nearest(fixed, scene)
        chosen = scene.goal.with_rows(nearest)
        return _gaps_of(points, chosen) - self._points.radii


def _float32(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, np.float32)


def _in_use(goal: Goal) -> ObstacleScene:
    """The scene of a goal: obstacles in use first."""
    used = goal.thresholds > 0.0
    order = np.argsort(~used, kind="stable")
    count = np.array(used.sum(), np.int32)
    values = map(_float32, goal.with_rows(order))
    return ObstacleScene(Goal(*values), count)


def _nearest(points: Array, scene: ObstacleScene) -> Array:
    """Number of the obstacle nearest to each point; the time follows those in use."""

    def compare(number: int, best: tuple[Array, Array]) -> tuple[Array, Array]:
        least, nearest = best
        obstacle = scene.goal.with_rows(number)
        gaps = _gaps_of(points, obstacle)
        is_nearer = gaps < least
        least = jnp.where(is_nearer, gaps, least)
        nearest = jnp.where(is_nearer, number, nearest)
        return least, nearest

    count = len(points)
    first = jnp.full(count, jnp.inf), jnp.zeros(count, int)
    _, nearest = jax.lax.fori_loop(0, scene.used, compare, first)
    return nearest


def _gaps_of(points: Array, goal: Goal) -> Array:
    centers = jnp.asarray(goal.obstacles)
    cores = jnp.asarray(goal.cores)
    gaps = distances(points, centers, cores)
    is_used = goal.thresholds > 0.0
    return jnp.where(is_used, gaps - goal.thresholds, jnp.inf)
