"""Terms: the residuals of a planning objective, independent of solver and each other.

A term returns residuals r in groups (a module, a pair of point and obstacle, ...) and a
weight mu for every group. The solver combines them: the paper's objective is the sum
of mu |r| (Chen et al. 2025, eq. (7)), least squares minimize the sum of mu |r|^2.
Targets have the same residual in both. Obstacles and changes have two terms each: the
paper uses 1 / d and the change of unit vectors, `BEST` uses the depth and the change of
bends.

XLA moves what does not depend on the candidate out of the solver's loop, so a term may
compute such values where it needs them.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import body_radii
from s2c2a.goals import Goal
from s2c2a.kinematics import center_line
from s2c2a.kinematics.bends import Numbers, Scalar, squared_norm
from s2c2a.obstacles import distances
from s2c2a.paper import obstacle_loss
from s2c2a.plugins.components import Component, Registry
from s2c2a.spaces import AXIS, CENTER_LINE_POINTS, POSITION

Configurations = Float[Array, "modules 3"]
Bends = Float[Array, "modules 2"]
Guard = Literal["tip", "arm"]
"""Points that avoid obstacles: the tip, as in the paper, or the arm.

The arm is five center-line points of every module, or more of a long one.
"""
OBSTACLES_AT_HAND = 4  # of a guarded point; chosen: more rarely touch it in one step
FAR = 1e6  # m; as far as goals may be (`goals.LARGEST`)


class Candidate(NamedTuple):
    """A configuration and its prediction.

    Attributes:
        configurations: shape (modules, 3), module frames.
        bends: the same configuration [rad], shape (modules, 2), module frames.
        states: predicted [m, 1], shape (modules, 6), base frame.
        points: guarded points [m], shape (points, 3), base frame.
        extrapolation: uncertainty from extrapolation beyond the data [m].
    """

    configurations: Configurations
    bends: Bends
    states: Float[Array, "modules 6"]
    points: Float[Array, "points 3"]
    extrapolation: Scalar


class Situation(NamedTuple):
    """Quantities that are fixed during one control step.

    Attributes:
        goal: of the next moment.
        last: the last plan with its current prediction.
        length: of the arm [m].
        bend_limits: of every module as sensed (`ArmGeometry.planned_bends`) [rad],
            shape (modules,).
        longest_step: largest change of a module's bend in a control step [rad]:
            `ArmGeometry.step_limit`, or less where the goal rests (`planning.rest`).
        on_sphere: whether configurations are kept at unit length.
        radii: of the body around the guarded points [m], shape (points,), or one.
        room: least distance from obstacles where a guide leads [m]; infinite elsewhere.
        steerable: see `ArmGeometry`.
    """

    goal: Goal
    last: Candidate
    length: float
    bend_limits: Float[Array, " modules"]
    longest_step: float | Scalar
    on_sphere: bool
    radii: Float[Numbers, " points"] = np.zeros(1, np.float32)
    room: Float[Numbers, ""] | float = np.inf
    steerable: Float[Numbers, "modules 2 2"] | None = None


@dataclass(frozen=True)
class GuardedPoints:
    """The points of an arm that avoid obstacles, and its body around them.

    They are the tip alone (Chen et al. 2025, eq. (5)), or points of the whole center line.

    Attributes:
        guard: which of them.
        lengths: of the modules [m].
        body_radii: of the modules [m].
    """

    guard: Guard
    lengths: tuple[float, ...]
    body_radii: tuple[float, ...]

    @classmethod
    def of(cls, arm: ArmSpec, guard: Guard) -> "GuardedPoints":
        """The guarded points of an arm."""
        lengths = tuple(module.length for module in arm.modules)
        return cls(guard, lengths, tuple(module.radius for module in arm.modules))

    def __call__(self, states: Float[Array, "modules 6"]) -> Float[Array, "points 3"]:
        """Their positions [m], base frame, at states."""
        if self.guard == "tip":
            return states[-1:, POSITION]
        lengths = jnp.asarray(self.lengths, dtype=jnp.float32)
        return center_line(states, lengths, self._of_a_module)

    @property
    def radii(self) -> Float[np.ndarray, " points"]:
        """Radii of the body around the points [m]."""
        if self.guard == "tip":
            return np.array(self.body_radii[-1:], np.float32)
        return body_radii(self.lengths, self.body_radii, self._of_a_module)

    @property
    def _of_a_module(self) -> int:
        """Points of a module: as close as on an arm of three, if there are fewer."""
        share = max(self.lengths) / sum(self.lengths)
        return max(CENTER_LINE_POINTS, round(3 * CENTER_LINE_POINTS * share))


def largest_bend(bends: Float[Array, "*knots modules 2"]) -> Scalar:
    """Largest length of a module's bend vector [rad]."""
    return jnp.sqrt(jnp.max(squared_norm(bends)))


TermWeights = Float[Numbers, "*#groups"] | float
Residual = tuple[TermWeights, Float[Array, "*groups axes"]]
"""Weights mu and residuals r of a term, in groups."""


@dataclass(frozen=True)
class Term(Component, ABC):
    """One term of the objective. Its own weight multiplies its residual."""

    @abstractmethod
    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Weights mu and residuals r.

        Returns:
            Weights of shape (groups), or one for all, and residuals of shape
            (groups, axes), with any number of group axes.
        """


@dataclass(frozen=True)
class Positions(Term):
    """Position error of module ends: mu_p, L_p (Chen et al. 2025, eq. (4)).

    Attributes:
        unit: of length, in parts of the arm's length.
    """

    unit: float = 0.4

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """In units, shape (modules, 3)."""
        goal = situation.goal
        error = candidate.states[:, POSITION] - goal.positions
        return goal.position_weights, error / (self.unit * situation.length)


@dataclass(frozen=True)
class Axes(Term):
    """Error of module end axes: mu_o, L_o (Chen et al. 2025, eq. (4)).

    Attributes:
        weight: relative to positions.
    """

    weight: float = 1.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 3)."""
        goal = situation.goal
        return goal.axis_weights, self.weight * (candidate.states[:, AXIS] - goal.axes)


@dataclass(frozen=True)
class Repulsion(Term):
    """1 / d within an obstacle's threshold, zero outside: mu_ob, L_ob.

    Chen et al. 2025, eq. (5).

    Attributes:
        unit: of length, in parts of the arm's length.
    """

    unit: float = 0.4

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """For every guarded point and obstacle, shape (points, obstacles, 1)."""
        goal = situation.goal
        unit = self.unit * situation.length
        gaps = distances(candidate.points[:, None], goal.obstacles, goal.cores)
        gaps = jnp.maximum(gaps - situation.radii[:, None], 0.0)
        repulsion = obstacle_loss(gaps / unit, goal.thresholds / unit)
        return goal.obstacle_weight, repulsion[..., None]


@dataclass(frozen=True)
class Obstacles(Term):
    """Depth of guarded points within thresholds and a margin: mu_ob of the goal.

    For every point, the obstacles that it is deepest in or nearest to count: points
    move a few centimeters in a step, and the time of a step hardly grows with the
    number of obstacles.

    Attributes:
        weight: relative to positions.
        unit: of length, in parts of the arm's length.
        margin: around obstacles beyond their thresholds, in parts of the arm's length;
            less where a guide leads through a narrow passage.
    """

    weight: float = 20.0
    unit: float = 0.4
    margin: float = 0.04

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """In units, shape (points, nearest obstacles, 1)."""
        goal = situation.goal
        length = situation.length
        distance = goal.thresholds + jnp.minimum(self.margin * length, situation.room)
        reach = jnp.where(goal.thresholds > 0.0, distance, -FAR)
        last_points = situation.last.points[:, None]
        last_gaps = distances(last_points, goal.obstacles, goal.cores)
        count = min(OBSTACLES_AT_HAND, len(reach))
        _, nearest = jax.lax.top_k(reach - last_gaps, count)
        centers, cores = jnp.asarray(goal.obstacles), jnp.asarray(goal.cores)
        points = candidate.points[:, None]
        gaps = distances(points, centers[nearest], cores[nearest])
        depths = jnp.maximum(reach[nearest] + situation.radii[:, None] - gaps, 0.0)
        scaled = self.weight * depths[..., None] / (self.unit * length)
        return goal.obstacle_weight, scaled


@dataclass(frozen=True)
class Change(Term):
    """Change of all modules' configurations: mu_d, L_d (Chen et al. 2025, eq. (6)).

    Attributes:
        weight: of the change.
    """

    weight: float = 1.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """One group, shape (1, 3 modules)."""
        change = candidate.configurations - situation.last.configurations
        return situation.goal.change_weight, self.weight * change.reshape(1, -1)


@dataclass(frozen=True)
class Shape(Term):
    """Distance from the desired bends, such as those on a way around obstacles.

    From another shape, the next point of a way may be out of reach.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 0.3

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 2)."""
        goal = situation.goal
        return goal.shape_weight, self.weight * (candidate.bends - goal.shape)


@dataclass(frozen=True)
class Evenness(Term):
    """Difference between neighboring bends: prefers shapes that the data contain.

    Modules beyond the last one with a target are left alone, since their motion also
    moves the others.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 0.02

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules - 1, 2)."""
        goal = situation.goal
        weights = goal.position_weights + goal.axis_weights
        outer_weights = jnp.flip(jnp.cumsum(jnp.flip(weights)))
        used = (outer_weights[1:] > 0.0).astype(jnp.float32)
        return used, self.weight * (candidate.bends[1:] - candidate.bends[:-1])


@dataclass(frozen=True)
class Extrapolation(Term):
    """Uncertainty of ends from extrapolation: the plan stays near the data.

    With the weight and the unit of positions, the cost is the expected squared distance
    of the tip from its target. Without a target it costs nothing: an arm that is to rest
    must not creep towards its data.

    Attributes:
        weight: relative to positions.
        unit: of length, in parts of the arm's length.
    """

    weight: float = 1.0
    unit: float = 0.4

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """In units, shape (1, 1)."""
        scaled = self.weight * candidate.extrapolation.reshape(1, 1)
        is_counted = jnp.asarray(situation.goal.has_target, jnp.float32)
        return is_counted, scaled / (self.unit * situation.length)


@dataclass(frozen=True)
class Limits(Term):
    """Excess of bends over their limits.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 5.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 1)."""
        angles = jnp.sqrt(squared_norm(candidate.bends) + 1e-9)
        excess = jnp.maximum(angles - situation.bend_limits, 0.0)
        return 1.0, self.weight * excess[:, None]


TERMS: Registry[Term] = Registry(
    "term",
    Term,
    {
        "Positions": Positions,
        "Axes": Axes,
        "Repulsion": Repulsion,
        "Obstacles": Obstacles,
        "Change": Change,
        "Shape": Shape,
        "Evenness": Evenness,
        "Extrapolation": Extrapolation,
        "Limits": Limits,
    },
)
