"""What plans are judged by: terms, each a few lines that know neither the solver nor each other; and what they see.

A term gives residuals r in groups (a module, a point and an obstacle, ...) and a weight
mu of every group. What becomes of a group is the solver's: the paper's objective is the
sum of mu |r| (Chen et al. 2025, eq. (7)), least squares take the sum of mu |r|^2.
Targets are the same residual in both. Obstacles and changes truly differ, so each
stands twice: the paper has 1 / d where `best` has a depth, and a change of vectors
where `best` has one of bends.

XLA takes what does not depend on the candidate out of a solver's loop, so a term may
work it out where it needs it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import center_line
from s2c2a.kinematics.bends import squared_norm
from s2c2a.components import Kind, Part
from s2c2a.spaces import AXIS, POSITION

Numbers = Array | np.ndarray  # NumPy outside the planner, traced inside
Configurations = Float[Array, "modules 3"]
Bends = Float[Array, "modules 2"]
Guard = Literal["tip", "arm"]
"""What keeps out of obstacles: the tip, as in the paper, or five center-line points of
every module."""


class Candidate(NamedTuple):
    """A configuration that is looked at, and what is predicted for it.

    Attributes:
        configurations: shape (modules, 3), module frames.
        bends: the same as bends [rad], shape (modules, 2), module frames.
        states: predicted [m, 1], shape (modules, 6), base frame.
        points: that keep out of obstacles [m], shape (points, 3), base frame.
        extrapolation: how far off ends may be because nothing was learned near there [m].
    """

    configurations: Configurations
    bends: Bends
    states: Float[Array, "modules 6"]
    points: Float[Array, "points 3"]
    extrapolation: Float[Array, ""]


class Situation(NamedTuple):
    """What is fixed while one control step is planned.

    Attributes:
        goal: what is asked; guides may change it.
        last: the last plan, as it is predicted now.
        length: of the arm [m].
        bend_limits: of every module as it is sensed (`ArmGeometry.planned_bends`)
            [rad], shape (modules,).
        longest_step: largest change of a module's bend in a control step [rad].
        on_sphere: whether configurations are kept at unit length.
        shape: bends that a guide leads to [rad], shape (modules, 2).
        led: one where a guide asks for that shape, else zero.
    """

    goal: Goal
    last: Candidate
    length: float
    bend_limits: Float[Array, " modules"]
    longest_step: float
    on_sphere: bool
    shape: Bends
    led: Float[Array, ""]


def guarded_points(
    arm: ArmSpec, guard: Guard
) -> Callable[[Float[Array, "modules 6"]], Float[Array, "points 3"]]:
    """States -> positions [m]: the tip alone (Chen et al. 2025, eq. (5)), or the whole arm's center line."""
    if guard == "tip":
        return lambda states: states[-1:, POSITION]
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, dtype=jnp.float32)
    return lambda states: center_line(states, lengths)


def norm(vectors: Float[Numbers, "*batch axis"]) -> Float[Array, "*batch"]:
    """Euclidean norm with gradient zero at zero."""
    squared = jnp.sum(jnp.asarray(vectors) ** 2, axis=-1)
    zero = squared == 0.0
    return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, squared)))


def largest_bend(bends: Bends) -> Float[Array, ""]:
    """Of all modules [rad]."""
    return jnp.sqrt(jnp.max(squared_norm(bends)))


OBSTACLES_AT_HAND = 4  # of every guarded point
NEAREST = 1e-3  # units from an obstacle's center, where 1 / d ends
FAR = 1e6  # m
Weights = Float[Numbers, "*groups"] | float
Residual = tuple[Weights, Float[Array, "*groups axes"]]


@dataclass(frozen=True)
class Term(Part, ABC):
    """One thing that plans are judged by. Its own weight multiplies its residual."""

    @abstractmethod
    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Weights mu, shape (groups) or one for all, and residuals, shape (groups, axes); any number of group axes."""


@dataclass(frozen=True)
class Positions(Term):
    """Module ends at their targets: mu_p of the goal, L_p (Chen et al. 2025, eq. (4)).

    Attributes:
        unit: what a length of one stands for, in parts of the arm's length.
    """

    unit: float = 0.4

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """In units, shape (modules, 3)."""
        goal = situation.goal
        unit = self.unit * situation.length
        return goal.position_weights, (
            candidate.states[:, POSITION] - goal.positions
        ) / unit


@dataclass(frozen=True)
class Axes(Term):
    """End axes as desired: mu_o of the goal, L_o (Chen et al. 2025, eq. (4)).

    Attributes:
        weight: beside positions.
    """

    weight: float = 1.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 3)."""
        goal = situation.goal
        return goal.axis_weights, self.weight * (candidate.states[:, AXIS] - goal.axes)


@dataclass(frozen=True)
class Repulsion(Term):
    """1 / d within an obstacle's threshold, zero outside: mu_ob of the goal, L_ob (Chen et al. 2025, eq. (5)).

    Attributes:
        unit: what a length of one stands for, in parts of the arm's length.
    """

    unit: float = 0.4

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Of every guarded point from every obstacle, shape (points, obstacles, 1)."""
        goal = situation.goal
        unit = self.unit * situation.length
        distances = norm((goal.obstacles - candidate.points[:, None]) / unit)
        inside = (distances <= goal.thresholds / unit) & (goal.thresholds > 0.0)
        pushes = jnp.where(
            inside,
            1.0 / jnp.where(inside & (distances > NEAREST), distances, NEAREST),
            0.0,
        )
        return goal.obstacle_weight, pushes[..., None]


@dataclass(frozen=True)
class Obstacles(Term):
    """How far guarded points are within thresholds and a margin: mu_ob of the goal.

    Of every point, those count that it is deepest in or nearest to: points move a few
    centimeters in a step, and the work of a step hardly grows with the number of
    obstacles.

    Attributes:
        weight: beside positions.
        unit: what a length of one stands for, in parts of the arm's length.
        margin: kept around obstacles beyond their thresholds, in parts of the arm's
            length.
    """

    weight: float = 20.0
    unit: float = 0.4
    margin: float = 0.04

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """In units, shape (points, at hand, 1)."""
        goal = situation.goal
        length = situation.length
        reaches = jnp.where(
            goal.thresholds > 0.0, goal.thresholds + self.margin * length, -FAR
        )
        depths_now = reaches - norm(situation.last.points[:, None] - goal.obstacles)
        _, near = jax.lax.top_k(depths_now, min(OBSTACLES_AT_HAND, len(reaches)))
        apart = norm(candidate.points[:, None] - jnp.asarray(goal.obstacles)[near])
        depths = jnp.maximum(reaches[near] - apart, 0.0)
        return goal.obstacle_weight, self.weight * depths[..., None] / (
            self.unit * length
        )


@dataclass(frozen=True)
class Change(Term):
    """The change of all modules' configurations together: mu_d of the goal, L_d (Chen et al. 2025, eq. (6)).

    Attributes:
        weight: of it.
    """

    weight: float = 1.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """One group, shape (1, 3 modules)."""
        change = candidate.configurations - situation.last.configurations
        return situation.goal.change_weight, self.weight * change.reshape(1, -1)


@dataclass(frozen=True)
class BendChange(Term):
    """Changes of bends: mu_d of the goal.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 0.03

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 2)."""
        return situation.goal.change_weight, self.weight * (
            candidate.bends - situation.last.bends
        )


@dataclass(frozen=True)
class Shape(Term):
    """Bends of the map's node, while the tip is led round obstacles: from another shape it may be out of reach.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 0.3

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 2)."""
        return situation.led, self.weight * (candidate.bends - situation.shape)


@dataclass(frozen=True)
class Evenness(Term):
    """Neighboring modules bent alike: of all shapes that serve, one that the data hold.

    Modules beyond the last of which something is asked stay as they are, for what they
    do moves the others.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 0.02

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules - 1, 2)."""
        goal = situation.goal
        asked = (
            jnp.flip(jnp.cumsum(jnp.flip(goal.position_weights + goal.axis_weights)))
            > 0.0
        )
        return asked[1:].astype(jnp.float32), self.weight * (
            candidate.bends[1:] - candidate.bends[:-1]
        )


@dataclass(frozen=True)
class Extrapolation(Term):
    """How far off ends may be where the forward model learned nothing: it stops short of what it does not know.

    Attributes:
        weight: beside positions.
        unit: what a length of one stands for, in parts of the arm's length.
    """

    weight: float = 3.0
    unit: float = 0.4

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """In units, shape (1, 1)."""
        return 1.0, self.weight * candidate.extrapolation.reshape(1, 1) / (
            self.unit * situation.length
        )


@dataclass(frozen=True)
class Limits(Term):
    """Bends beyond their limits.

    Attributes:
        weight: [1/rad].
    """

    weight: float = 5.0

    def residual(self, candidate: Candidate, situation: Situation) -> Residual:
        """Shape (modules, 1)."""
        angles = jnp.sqrt(squared_norm(candidate.bends) + 1e-9)
        return 1.0, self.weight * jnp.maximum(angles - situation.bend_limits, 0.0)[
            :, None
        ]


TERMS = Kind.of(
    "term",
    Term,
    Positions,
    Axes,
    Repulsion,
    Obstacles,
    Change,
    BendChange,
    Shape,
    Evenness,
    Extrapolation,
    Limits,
)
