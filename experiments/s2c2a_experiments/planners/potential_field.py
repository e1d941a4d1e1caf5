"""Artificial potential field, minimized by beetle-antennae search [24MD].

Targets attract the module ends, and obstacles repel the points of the body that are
nearer than a range (Khatib, Int. J. Robotics Research 5, 1986). Each control step,
beetles start from the last bends: a beetle feels the potential with two antennae in a
random direction, steps to the lower side, and shortens steps and antennae (Jiang and Li,
Int. J. Robotics and Control 1, 2018). The arm goes a share of the way to the lowest
point that any of them found, and stays where none is lower.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.execution.compilation import compiled
from s2c2a.goals import Goal
from s2c2a.kinematics import commanded_part, limit_lengths, states_from_bends
from s2c2a.kinematics.bends import Numbers
from s2c2a.planning.terms import Guard, GuardedPoints
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import AXIS, POSITION
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment
from s2c2a_experiments.planners.nearby import Clearances, Nearby

BEETLES = 16  # chosen: a search in the plane of a module needs a few directions
ITERATIONS = 40  # of a control step; with 16 beetles within 10 ms on one core
SHORTENING = 0.92  # of steps and antennae in an iteration: 0.04 of them remain
OBSTACLES = 4  # nearest; chosen: more rarely repel in one step
LEAST_CLEARANCE = 1e-3  # of the arm's length; where the potential goes on as a line
EVENNESS = 1e-3  # potential [1/rad^2]; chosen: it moves the tip by 1 mm at most
AXIS_WEIGHT = 0.5  # of axes beside positions, which are in units of the arm's length

Shape = Float[Numbers, "modules 2"]
"""Bends inside the program."""
Potential = Float[Array, ""]
States = Float[Array, "modules 6"]


@dataclass(frozen=True)
class PotentialField(BendPlanning):
    """Attraction and repulsion, and the search for a lower potential.

    Attributes:
        gain: share of the way to the lowest point found that a step goes.
        damping: potential of a change of bends [1/rad^2].
        repulsion: potential of obstacles beside targets.
        repulsion_range: clearance where obstacles begin to repel, in parts of the
            arm's length.
    """

    gain: float = 0.5
    damping: float = 0.01
    repulsion: float = 1e-5
    repulsion_range: float = 0.06
    name = "apf"
    supports = frozenset({"guard"})
    limits: ClassVar[Ranges] = {
        "gain": (0.0, 1.0),
        "damping": (0.0, 100.0),
        "repulsion": (0.0, 1.0),
        "repulsion_range": (1e-3, 1.0),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "Beetles":
        guarded = GuardedPoints.of(arm, guard)
        return Beetles(arm, guarded, self)


class PotentialModel(NamedTuple):
    """What the potential depends on beside bends and goal.

    Attributes:
        options: of the planner.
        guarded: points of the body that obstacles repel.
        lengths: of modules [m], shape (modules,).
        bend_limits: of a plan [rad], shape (modules,).
        step_limit: largest change of a module's bend [rad].
        steerable: see `ArmGeometry`.
    """

    options: PotentialField
    guarded: GuardedPoints
    lengths: Float[np.ndarray, " modules"]
    bend_limits: Float[np.ndarray, " modules"]
    step_limit: float
    steerable: Float[np.ndarray, "modules 2 2"] | None

    def potential(
        self, bends: Shape, last: Shape, goal: Goal, obstacles: Nearby
    ) -> Potential:
        """Attraction, repulsion, damping and unevenness at bends."""
        states = self._states(bends)
        length = self.lengths.sum()
        attraction = self._attraction(states, goal)
        clearances = obstacles.clearances(states, self.guarded) / length
        repulsion = jnp.sum(self._repulsion(clearances))
        change = bends - last
        damping = self.options.damping * jnp.sum(change**2)
        differences = jnp.diff(bends, axis=0)
        unevenness = EVENNESS * jnp.sum(differences**2)
        return attraction / 2.0 + repulsion + damping + unevenness

    def _attraction(self, states: States, goal: Goal) -> Potential:
        """Weighted squares of the errors of positions, in arm lengths, and of axes."""
        misses = states[:, POSITION] - goal.positions
        errors = jnp.sum(misses**2, axis=-1)
        turns = states[:, AXIS] - goal.axes
        axis_errors = jnp.sum(turns**2, axis=-1)
        length = self.lengths.sum()
        attraction = goal.position_weights @ errors / length**2
        axis_attraction = goal.axis_weights @ axis_errors * AXIS_WEIGHT**2
        return attraction + axis_attraction

    def lowest(self, last: Shape, goal: Goal, key: Array) -> Shape:
        """The lowest point that a beetle found; the last bends where none is lower."""
        states = self._states(last)
        obstacles = Nearby.of(goal).nearest(states, self.guarded, OBSTACLES)

        def level(bends: Shape) -> Potential:
            allowed = self._allowed(bends, last)
            return self.potential(allowed, last, goal, obstacles)

        levels_of = jax.vmap(level)
        allowed_of = jax.vmap(self._allowed, (0, None))

        def crawl(state, reach):
            points, best, best_levels = state
            antennae = jnp.concatenate([points + reach, points - reach])
            right, left = jnp.split(levels_of(antennae), 2)
            sides = jnp.sign(right - left)
            steps = reach * sides[:, None, None]
            points = allowed_of(points - steps, last)
            levels = levels_of(points)
            is_lower = levels < best_levels
            best = jnp.where(is_lower[:, None, None], points, best)
            best_levels = jnp.where(is_lower, levels, best_levels)
            return (points, best, best_levels), None

        points = jnp.tile(last, (BEETLES, 1, 1))
        start = points, points, levels_of(points)
        reaches = self._reaches(key, last.shape)
        (_, best, levels), _ = jax.lax.scan(crawl, start, reaches)
        return best[jnp.argmin(levels)]

    def _reaches(self, key: Array, shape: tuple[int, ...]) -> Array:
        """Antennae of every iteration and beetle [rad], in random directions."""
        directions = jax.random.normal(key, (ITERATIONS, BEETLES, *shape))
        squares = jnp.sum(directions**2, axis=(-2, -1), keepdims=True)
        norms = jnp.sqrt(squares)
        numbers = jnp.arange(ITERATIONS)
        spans = self.step_limit * SHORTENING**numbers
        spans = spans[:, None, None, None]  # (iterations, beetles, modules, 2)
        return spans * directions / norms

    def _repulsion(self, clearances: Clearances) -> Clearances:
        """(1/d - 1/d0)^2 / 2 within the range d0; along its tangent below the least d."""
        farthest = self.options.repulsion_range
        distance = jnp.clip(clearances, LEAST_CLEARANCE, farthest)
        steepness = 1.0 / distance - 1.0 / farthest
        below = LEAST_CLEARANCE - clearances
        depth = jnp.maximum(below, 0.0)
        tangent = depth * steepness / distance**2
        levels = steepness**2 / 2.0 + tangent
        return self.options.repulsion * levels

    def _states(self, bends: Shape) -> States:
        return states_from_bends(bends, self.lengths)

    def _allowed(self, bends: Shape, last: Shape) -> Shape:
        change = limit_lengths(bends - last, self.step_limit)
        within = limit_lengths(last + change, self.bend_limits)
        return commanded_part(within, self.steerable)


class Beetles:
    """The search, and its random numbers."""

    def __init__(self, arm: ArmSpec, guarded: GuardedPoints, options: PotentialField):
        """Compile for an arm."""
        geometry = ArmGeometry.of(arm)
        steerable = geometry.steerable
        potential = PotentialModel(
            options,
            guarded,
            geometry.lengths.astype(np.float32),
            geometry.planned_bends.astype(np.float32),
            geometry.step_limit,
            None if steerable is None else steerable.astype(np.float32),
        )
        self._gain = options.gain
        self._lowest = compiled(PotentialModel.lowest, potential)
        self._rest = np.zeros((arm.module_count, 2), np.float32)
        resting = Moment(self._rest, self._rest, None)
        self.start(resting)
        goal = Goal.of(arm.module_count)
        self._search(self._rest, goal)

    def start(self, moment: Moment) -> None:
        """Begin with the same random numbers every time."""
        self._random = np.random.default_rng(0)

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward a lower potential; without targets, the last bends."""
        if not goal.has_target:
            return moment.bends
        last = moment.bends
        change = self._search(last, goal) - last
        return last + self._gain * change

    def _search(self, bends: Bends, goal: Goal) -> Bends:
        seed = self._random.integers(2**32, size=2, dtype=np.uint32)
        key = jax.random.wrap_key_data(jnp.asarray(seed))
        lowest = self._lowest(bends, goal, key)
        return np.asarray(lowest)
