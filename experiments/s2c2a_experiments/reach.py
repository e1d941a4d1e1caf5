"""Reachability beside a long search: verdicts, misses, and time.

Poses are drawn around an arm, half of them beside spheres that the whole arm keeps out
of. The long search minimizes the same sum of squares from many starts, which are drawn
independently of the table of shapes of `s2c2a.planning.reach`. Its errors are computed
by code of its own.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a import jobs
from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import center_line, directions_at
from s2c2a.evaluation import Row
from s2c2a.execution.compilation import compiled
from s2c2a.goals import Goal
from s2c2a.kinematics import limit_lengths, norm
from s2c2a.models.forward_model import ForwardModel, PCCForwardModel
from s2c2a.planning.reach import (
    AXIS_LENGTH,
    DEPTH_WEIGHT,
    EVENNESS,
    PerModule,
    Reachability,
    Reached,
    RestingArm,
)
from s2c2a.planning.solvers import ResidualVector, solve_least_squares
from s2c2a.planning.terms import Bends, GuardedPoints
from s2c2a.spaces import AXIS, POSITION
from s2c2a.strategies import recipe_named

EXPERIMENT = "reach"
KINDS = ("within reach", "anywhere", "position and axis")
STARTS = 64  # of the long search
ITERATIONS = 100  # of the long search from each start
SIDE_BY_SIDE = 10  # poses in a call of the long search
MOST_OBSTACLES = 8
RADII = (0.04, 0.12)  # of the arm's length
FREE_BASE = 0.1  # of the arm's length: no shape moves the arm there
AROUND = 0.8  # of the arm's length, from its middle: all that it reaches, and more
TURNED = 0.4  # of half of the axes, per coordinate


@dataclass(frozen=True)
class ReachStudy:
    """What is compared.

    Attributes:
        arms: the first one with trained networks, the others as arcs.
        poses: number of poses of each arm.
        seed: of data and training, poses and starts.
    """

    arms: tuple[ArmSpec, ...]
    poses: int = 500
    seed: int = 0


class Poses(NamedTuple):
    """Poses of the tip.

    Attributes:
        goals: with the poses as first axis.
        kinds: which of `KINDS` each is, shape (poses,).
        are_beside: whether each is beside obstacles, shape (poses,).
    """

    goals: Goal
    kinds: np.ndarray
    are_beside: Bool[np.ndarray, " poses"]

    @classmethod
    def drawn(cls, arm: ArmSpec, model: ForwardModel, count: int, seed: int) -> "Poses":
        """Draw so many poses, a third of each of `KINDS`.

        Args:
            arm: its bend limits hold.
            model: predicts the states of drawn shapes.
            count: number of poses.
            seed: of all samples.
        """
        random = np.random.default_rng(seed)
        resting = RestingArm.of(arm, model)
        # every pose has the shape that it is drawn from, and another one in its way
        shapes = drawn_bends(resting.limits, (2, count), random)
        states = np.asarray(compiled(_states_of, resting)(shapes))
        lines = center_line(states, resting.lengths)
        kinds = np.resize(KINDS, count)
        are_beside = np.arange(count) // len(KINDS) % 2 == 1
        goals = []
        for number, kind in enumerate(kinds):
            goal = _drawn_goal(kind, states[0, number], arm, random)
            if are_beside[number]:
                line = lines[random.integers(2), number]
                spheres = np.reshape(list(_spheres(arm, line, random)), (-1, 4))
                goal = goal.with_obstacles(spheres[:, :3], spheres[:, 3])
            goals.append(goal)
        stacked = Goal.stacked(goals)
        return cls(stacked.with_rows(slice(MOST_OBSTACLES)), kinds, are_beside)


def drawn_bends(
    limits: PerModule,
    shape: tuple[int, ...],
    random: np.random.Generator,
) -> Float[np.ndarray, "*shapes modules 2"]:
    """Bends [rad], uniform in the discs within the limits."""
    areas = random.uniform(size=(*shape, len(limits)))
    sizes = limits * np.sqrt(areas)
    angles = random.uniform(0.0, 2.0 * np.pi, sizes.shape)
    return (sizes[..., None] * directions_at(angles)).astype(np.float32)


def _drawn_goal(
    kind: str,
    states: Float[np.ndarray, "modules 6"],
    arm: ArmSpec,
    random: np.random.Generator,
) -> Goal:
    """A pose of the tip, from the states of a drawn shape or from anywhere."""
    goal = Goal.of(arm.module_count)
    if kind == "anywhere":
        direction = random.normal(size=3)
        distance = AROUND * arm.length * np.cbrt(random.uniform())
        middle = np.array([0.0, 0.0, 0.5 * arm.length])
        way = distance * direction / np.linalg.norm(direction)
        return goal.with_position(middle + way)
    goal = goal.with_position(states[-1, POSITION])
    if kind == "position and axis":
        turn = TURNED * random.integers(2) * random.normal(size=3)
        goal = goal.with_axis(states[-1, AXIS] + turn)
    return goal


def _spheres(
    arm: ArmSpec, line: Float[np.ndarray, "points 3"], random: np.random.Generator
) -> Iterator[np.ndarray]:
    """Centers and radii [m] of spheres beside or on a center line."""
    for _ in range(random.integers(1, MOST_OBSTACLES + 1)):
        radius = random.uniform(*RADII) * arm.length
        place = line[random.integers(len(line) // 3, len(line))]
        center = place + random.normal(0.0, radius, 3)
        if np.linalg.norm(center) > radius + FREE_BASE * arm.length:
            yield np.append(center, radius)


class LongSearch:
    """Many starts and many iterations for each pose."""

    def __init__(self, arm: ArmSpec, model: ForwardModel, seed: int):
        """Compile nothing yet.

        Args:
            arm: its bend limits hold; all of it keeps clear of obstacles.
            model: predicts states.
            seed: of the starts.
        """
        self._resting = RestingArm.of(arm, model)
        self._random = np.random.default_rng([seed, 1])
        parts = self._resting, GuardedPoints.of(arm, "arm")
        self._search = compiled(_searched, *parts)
        self._misses = compiled(_misses, *parts)

    def nearest(self, goals: Goal) -> Reached:
        """The nearest shapes; goals as of `Reachability.nearest`, of the tip alone."""
        count = len(goals.positions)
        rows = np.resize(np.arange(count), -(-count // SIDE_BY_SIDE) * SIDE_BY_SIDE)
        limits = self._resting.limits
        starts = drawn_bends(limits, (len(rows), STARTS), self._random)
        found = [
            self._search(_taken(goals, rows[part]), starts[part])
            for part in np.arange(len(rows)).reshape(-1, SIDE_BY_SIDE)
        ]
        joined = {
            name: np.concatenate([call[name] for call in found])[:count]
            for name in Reached._fields
        }
        return Reached(**joined)

    def misses(
        self, goals: Goal, bends: Float[np.ndarray, "poses modules 2"]
    ) -> Float[np.ndarray, " poses"]:
        """Distances of shapes from goals, in which axes and depths count too [m]."""
        return np.asarray(self._misses(goals, bends))


def _taken(goals: Goal, rows: np.ndarray) -> Goal:
    return Goal(*(np.asarray(values)[rows] for values in goals))


def _states_of(arm: RestingArm, bends: Array) -> Array:
    return jax.vmap(jax.vmap(arm.states))(bends)


def _residuals(
    arm: RestingArm, points_of: GuardedPoints, goal: Goal, bends: Bends
) -> ResidualVector:
    """What both searches minimize, in parts of the arm's length."""
    length = jnp.sum(jnp.asarray(arm.lengths))
    states = arm.states(bends)
    has_axis = goal.axis_weights[-1] > 0.0
    turn = AXIS_LENGTH * (states[-1, AXIS] - goal.axes[-1])
    depths = jnp.maximum(-_clearances(points_of(states), goal), 0.0)
    return jnp.concatenate(
        [
            (states[-1, POSITION] - goal.positions[-1]) / length,
            jnp.where(has_axis, turn, 0.0),
            DEPTH_WEIGHT * depths.reshape(-1) / length,
            EVENNESS * jnp.diff(bends, axis=0).reshape(-1),
        ]
    )


def _clearances(
    points: Float[Array, "points 3"], goal: Goal
) -> Float[Array, "points obstacles"]:
    """Distances of points from obstacles [m]; infinite for unused rows."""
    away = points[:, None, :] - goal.obstacles[None]
    gaps = norm(away) - goal.thresholds
    return jnp.where(goal.thresholds > 0.0, gaps, jnp.inf)


def _misses(
    arm: RestingArm, points_of: GuardedPoints, goals: Goal, bends: Array
) -> Float[Array, " poses"]:
    def miss(goal: Goal, shape: Bends) -> Float[Array, ""]:
        return norm(_residuals(arm, points_of, goal, shape)) * jnp.sum(arm.lengths)

    return jax.vmap(miss)(goals, bends)


def _searched(
    arm: RestingArm, points_of: GuardedPoints, goals: Goal, starts: Array
) -> dict[str, Array]:
    """The fields of `Reached` for the best of all starts of each pose."""

    def project(bends: Bends) -> Bends:
        return limit_lengths(bends, arm.limits)

    def searched(
        goal: Goal, starts: Float[Array, "starts modules 2"]
    ) -> dict[str, Array]:
        def solved(start: Bends) -> tuple[Bends, Float[Array, ""]]:
            def residuals(bends: Bends) -> ResidualVector:
                return _residuals(arm, points_of, goal, bends)

            return solve_least_squares(residuals, start, project, ITERATIONS)

        found, costs = jax.vmap(solved)(starts)
        return _reached(arm, points_of, goal, found[jnp.argmin(costs)])

    return jax.vmap(searched)(goals, starts)


def _reached(
    arm: RestingArm, points_of: GuardedPoints, goal: Goal, bends: Bends
) -> dict[str, Array]:
    """What a shape reaches; the model's deviation and other starts are left out."""
    states = arm.states(bends)
    tip = states[-1]
    along = jnp.sum(tip[AXIS] * goal.axes[-1])
    cosine = jnp.clip(along, -1.0, 1.0)
    has_axis = goal.axis_weights[-1] > 0.0
    return {
        "bends": bends,
        "states": states,
        "position_errors": norm(tip[POSITION] - goal.positions[-1]),
        "axis_errors": jnp.where(has_axis, jnp.arccos(cosine), 0.0),
        "clearances": jnp.min(_clearances(points_of(states), goal)),
        "predictive_std": jnp.zeros(()),
        "agreeing": jnp.zeros(()),
    }


class ReachComparison(NamedTuple):
    """Both searches on the same poses.

    Attributes:
        poses: the poses.
        within: whether `Reachability.nearest` reaches each, shape (poses,).
        within_long: whether the long search does, shape (poses,).
        farther: by how much it misses each by more than the long search [m], shape
            (poses,).
        time: for a pose in a batch [s].
        long_time: of the long search [s].
    """

    poses: Poses
    within: Bool[np.ndarray, " poses"]
    within_long: Bool[np.ndarray, " poses"]
    farther: Float[np.ndarray, " poses"]
    time: float
    long_time: float


def compared(
    arm: ArmSpec, model: ForwardModel, count: int, seed: int
) -> ReachComparison:
    """Compare both searches on drawn poses; arguments as of `Poses.drawn`."""
    poses = Poses.drawn(arm, model, count, seed)
    search = Reachability(arm, model, guard="arm")
    long_search = LongSearch(arm, model, seed)
    found, seconds = _timed(search, poses.goals)
    best, long_seconds = _timed(long_search, poses.goals)
    misses, least = (
        long_search.misses(poses.goals, reached.bends) for reached in (found, best)
    )
    return ReachComparison(
        poses,
        found.within(arm.length),
        best.within(arm.length),
        misses - least,
        seconds / count,
        long_seconds / count,
    )


def _timed(search: Reachability | LongSearch, goals: Goal) -> tuple[Reached, float]:
    """The nearest shapes, and the time [s] of a second call that compiles nothing."""
    rows = np.flatnonzero(goals.thresholds.any(axis=1))[:1]
    search.nearest(_taken(goals, rows if len(rows) else np.arange(1)))
    began = time.perf_counter()
    reached = search.nearest(goals)
    return reached, time.perf_counter() - began


def reach_rows(study: ReachStudy, make: jobs.Make) -> list[Row]:
    """Rows of every arm: of all poses, of each kind, and beside obstacles.

    Args:
        study: what is compared.
        make: finds or makes networks and recordings.
    """
    recipe = recipe_named("best")
    artifact = jobs.NetworksArtifact.of_recipe(study.arms[0], recipe, study.seed)
    (networks,) = make([artifact])
    rows: list[Row] = []
    for number, arm in enumerate(study.arms):
        model: ForwardModel = PCCForwardModel.of(arm)
        heading = arm.name, "none", "arcs", "none"
        if number == 0:
            model = networks.c2s
            heading = arm.name, "none", "trained networks", recipe.name
        # arcs of arms alike would give the same rows
        comparison = compared(arm, model, study.poses, study.seed + number)
        rows += _comparison_rows(heading, comparison, study.seed)
    return rows


def _comparison_rows(
    heading: tuple[str, str, str, str], comparison: ReachComparison, seed: int
) -> Iterator[Row]:
    """Rows of one arm: shares, misses and times."""
    poses = comparison.poses
    groups = {"all": np.ones(len(poses.kinds), bool)}
    groups |= {kind: poses.kinds == kind for kind in KINDS}
    groups |= {"beside obstacles": poses.are_beside}
    for name, chosen in groups.items():
        within = comparison.within[chosen]
        within_long = comparison.within_long[chosen]
        farther = 100.0 * comparison.farther[chosen]
        metrics = {
            ("verdicts agree", "of poses"): np.mean(within == within_long),
            ("reached", "of poses"): np.mean(within),
            ("reached by the long search alone", "of poses"): np.mean(
                within_long & ~within
            ),
            ("farther, 99th percentile", "cm"): np.percentile(farther, 99),
            ("farther, largest", "cm"): farther.max(),
        }
        if name == "all":
            metrics["time", "ms a pose"] = 1e3 * comparison.time
            metrics["time of the long search", "ms a pose"] = 1e3 * comparison.long_time
        for names, value in metrics.items():
            yield Row(EXPERIMENT, name, *heading, *names, float(value), seeds=(seed,))
