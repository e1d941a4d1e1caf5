"""What a plan is made from in one control step: what is fixed in it, and a candidate for the next configuration."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import centre_line
from s2c2a.spaces import POSITION

Numbers = Array | np.ndarray  # NumPy outside the planner, traced inside
Configurations = Float[Array, "modules 3"]
Bends = Float[Array, "modules 2"]
GuardedPoints = Callable[[Float[Array, "modules 6"]], Float[Array, "points 3"]]
Guard = Literal["tip", "arm"]
"""What keeps out of obstacles: the tip, as in the paper, or five centre-line points of every module."""


class Candidate(NamedTuple):
    """A configuration that is looked at, and what is predicted for it.

    Attributes:
        configurations: shape (modules, 3), module frames.
        bends: the same as bends [rad], shape (modules, 2), module frames.
        states: predicted [m, 1], shape (modules, 6), base frame.
        points: that keep out of obstacles [m], shape (points, 3), base frame.
    """

    configurations: Configurations
    bends: Bends
    states: Float[Array, "modules 6"]
    points: Float[Array, "points 3"]


class Situation(NamedTuple):
    """What is fixed while one control step is planned.

    Attributes:
        goal: what is asked; guides may change it.
        last: the last plan, as it is predicted now.
        length: of the arm [m].
        bend_limits: of every module [rad], shape (modules,).
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


def guarded_points(arm: ArmSpec, guard: Guard) -> GuardedPoints:
    """States -> positions [m]: the tip alone (Chen et al. 2025, eq. (5)), or the whole arm's centre line."""
    if guard == "tip":
        return lambda states: states[-1:, POSITION]
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, dtype=jnp.float32)
    return lambda states: centre_line(states, lengths)


def norm(vectors: Float[Numbers, "*batch axis"]) -> Float[Array, "*batch"]:
    """Euclidean norm with gradient zero at zero."""
    squared = jnp.sum(jnp.asarray(vectors) ** 2, axis=-1)
    zero = squared == 0.0
    return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, squared)))
