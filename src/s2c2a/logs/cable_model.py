r"""Quasi-static model of cables with free angles and gains, used to interpret logs.

The bends b of all modules minimize the energy

$$ \tfrac12 b^T K b + \tfrac12 \sum_c \max(0, p_c - a_c \cdot b)^2, \qquad p_c = g_c x_c
- o_c, $$

with the pull p of a cable (the bend [rad] that it commands) and its direction a on the
modules that it runs through. A slack cable exerts no force. K holds the stiffness of
the arm and gravity, relative to the stiffness of the cables. Ends follow by piecewise
constant curvature. For an arm driven by tension, K b is the sum of a_c p_c.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics import states_from_bends

Numbers = Any
"""NumPy arrays, or arrays traced by JAX."""
SLACK_ITERATIONS = 8  # updates of which cables are slack


class Wiring(NamedTuple):
    """Motors and routes of all cables, as arrays of one compiled function.

    Attributes:
        reach: 1 where a cable bends a module, shape (cables, modules).
        drive: index of the cable's motor, shape (cables,).
        turn: angle from the motor's direction to the cable's [rad], shape (cables,).
        sign: 1 where a larger column pulls the cable, -1 where it releases it, shape
            (cables,).
    """

    reach: np.ndarray
    drive: np.ndarray
    turn: np.ndarray
    sign: np.ndarray


class CableParameters(NamedTuple):
    """Parameters of the cable model.

    Attributes:
        angles: directions of the motors [rad], shape (drives,).
        gain: logarithm of the bend [rad] that a cable commands per unit of its column.
        gains: deviations of the motors' logarithmic gains from it, shape (drives,).
        offsets: bends by which a column's zero falls short [rad], shape (drives,).
        lengths: logarithms of the module lengths [m], shape (modules,).
        stiffness: logarithm of the arm's stiffness over that of a cable.
        gravity: stiffness of gravity over that of a cable; positive for a hanging arm.
        tilt: rotation of the base frame about its x and y [rad], shape (2,).
        base: position of the base [m], frame of the log, shape (3,).
    """

    angles: Numbers
    gain: Numbers
    gains: Numbers
    offsets: Numbers
    lengths: Numbers
    stiffness: Numbers
    gravity: Numbers
    tilt: Numbers
    base: Numbers


def cable_directions(parameters: CableParameters, wiring: Wiring) -> Numbers:
    """Change of each cable's length with the bends, shape (cables, 2 modules)."""
    angle = parameters.angles[wiring.drive] + wiring.turn
    direction = jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
    changes = wiring.reach[:, :, None] * direction[:, None, :]
    return changes.reshape(len(angle), -1)


def stiffness_matrix(parameters: CableParameters) -> Numbers:
    """K: equal stiffness of all modules, and gravity of a uniform chain."""
    modules = len(parameters.lengths)
    elastic = jnp.exp(parameters.stiffness) * jnp.eye(modules)
    gravity = parameters.gravity * jnp.asarray(gravity_matrix(modules))
    return jnp.kron(elastic + gravity, jnp.eye(2))


def gravity_matrix(modules: int) -> Float[np.ndarray, "modules modules"]:
    """Hessian of a uniform hanging chain's potential by bends, largest entry one."""
    points = 20  # of a module, for the integral
    along = (np.arange(modules * points) + 0.5) / points
    slopes = np.clip(along[:, None] - np.arange(modules), 0.0, 1.0)
    matrix = np.einsum("s,sj,sk->jk", modules - along, slopes, slopes)
    return matrix / matrix.max()


def equilibrium_bends(
    parameters: CableParameters,
    wiring: Wiring,
    columns: Float[Array | np.ndarray, "rows drives"],
    tension: bool,
) -> Float[Array, "rows modules 2"]:
    """Bends [rad] at rest, differentiable with respect to the parameters.

    Which cables are slack is found first and then fixed.
    """
    directions = cable_directions(parameters, wiring)
    stiffness = stiffness_matrix(parameters)
    gains = jnp.exp(parameters.gain + parameters.gains)
    pulls = wiring.sign * (gains * columns)[:, wiring.drive]
    pulls = pulls - parameters.offsets[wiring.drive]
    if tension:
        bends = jnp.linalg.solve(stiffness, (pulls @ directions).T).T
        return bends.reshape(len(columns), -1, 2)
    fixed = jax.lax.stop_gradient((stiffness, directions, pulls))

    def update(_, taut):
        bends = _solve(taut, *fixed)
        return (fixed[2] > bends @ fixed[1].T).astype(pulls.dtype)

    taut = jax.lax.fori_loop(0, SLACK_ITERATIONS, update, jnp.ones_like(pulls))
    bends = _solve(taut, *fixed)
    inverse = jnp.linalg.inv(_taut_stiffness(taut, *fixed[:2]))
    # the residual is zero in value; one Newton step carries the gradient cheaply
    stretch = taut * (pulls - bends @ directions.T)
    residual = stretch @ directions - bends @ stiffness
    bends = bends + jnp.einsum("rij,rj->ri", inverse, residual)
    return bends.reshape(len(columns), -1, 2)


def _taut_stiffness(taut, stiffness, directions):
    """Stiffness of the arm and its taut cables, shape (rows, bends, bends)."""
    return stiffness + jnp.einsum("rc,ci,cj->rij", taut, directions, directions)


def _solve(taut, stiffness, directions, pulls):
    """Bends at which the arm rests on its taut cables, shape (rows, bends)."""
    matrix = _taut_stiffness(taut, stiffness, directions)
    moments = (taut * pulls) @ directions
    return jnp.linalg.solve(matrix, moments[..., None])[..., 0]


def tilt_rotation(tilt: Numbers) -> Float[Array, "3 3"]:
    """Small rotation about x and y, as a Cayley transform."""
    identity = jnp.eye(3)
    skew = jnp.cross(jnp.append(tilt, 0.0), identity).T
    return jnp.linalg.solve(identity - skew / 2, identity + skew / 2)


def states_in_base(
    parameters: CableParameters, bends: Float[Array, "rows modules 2"]
) -> Float[Array, "rows modules 6"]:
    """States [m, 1] in the base frame."""
    return states_from_bends(bends, jnp.exp(parameters.lengths))


def states_in_log(
    parameters: CableParameters,
    states: Float[Array, "rows modules 6"],
    axes: Float[Array, "3 3"],
) -> Float[Array, "rows modules 6"]:
    """States [m, 1] in the frame of the log, from those in the base frame.

    Args:
        parameters: tilt and base.
        states: states in the base frame.
        axes: axes of the untilted base frame as columns, frame of the log.
    """
    rotation = axes @ tilt_rotation(parameters.tilt)
    positions = states[..., :3] @ rotation.T + parameters.base
    return jnp.concatenate([positions, states[..., 3:] @ rotation.T], axis=-1)
