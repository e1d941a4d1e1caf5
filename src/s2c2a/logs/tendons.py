r"""A simple model of what cables do, with every angle and gain free: what logs are registered and understood with.

Bends b of all modules settle where the energy is least,

$$ \tfrac12 b^T K b + \tfrac12 \sum_c \max(0, p_c - a_c \cdot b)^2, \qquad p_c = g_c x_c
- o_c, $$

with a cable's pull p (the bend [rad] that it asks for) and its direction a on the
modules that it runs through; a slack cable asks for nothing; K holds the arm's own
stiffness and gravity, over that of the cables. Ends follow by PCC. On an arm driven by
tension, K b = sum of a_c p_c.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics import states_from_bends

Numbers = Any
"""Of NumPy, or traced by JAX."""
SETTLED = 8  # rounds in which cables become slack or taut


class Wiring(NamedTuple):
    """Which motor pulls which cable how, and what the cable runs through; arrays, so that all are one program.

    Attributes:
        reach: 1 where a cable bends a module, shape (cables, modules).
        drive: number of its motor, shape (cables,).
        turn: from the motor's direction to the cable's [rad].
        sign: 1 where the motor's column pulls, -1 where it lets go.
    """

    reach: np.ndarray
    drive: np.ndarray
    turn: np.ndarray
    sign: np.ndarray


class Guess(NamedTuple):
    """The numbers that are found; what they are while nothing is found yet.

    Attributes:
        angles: of the motors' directions [rad], shape (drives,).
        gain: logarithm of the bend that a cable asks for, for a unit of its column
            [rad].
        gains: what each motor's logarithm is off from that, shape (drives,).
        offsets: bend that a column's zero falls short of [rad], shape (drives,).
        lengths: logarithm of the modules' lengths [m], shape (modules,).
        stiffness: logarithm of the arm's stiffness over that of a cable.
        gravity: the same of gravity; positive where the arm hangs.
        tilt: of the base frame about its x and y [rad].
        base: where the base is [m], frame of the file.
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


def directions(guess: Guess, wiring: Wiring) -> Numbers:
    """What each cable's length says of the bends."""
    angle = guess.angles[wiring.drive] + wiring.turn
    way = jnp.stack([jnp.cos(angle), jnp.sin(angle)], axis=-1)
    return (wiring.reach[:, :, None] * way[:, None, :]).reshape(len(angle), -1)


def stiffness_of(guess: Guess) -> Numbers:
    """K: the arm's own, the same for all modules, and gravity's on an even chain."""
    modules = len(guess.lengths)
    inner = jnp.exp(guess.stiffness) * jnp.eye(modules) + guess.gravity * jnp.asarray(
        gravity_shape(modules)
    )
    return jnp.kron(inner, jnp.eye(2))


def gravity_shape(
    modules: int, points: int = 20
) -> Float[np.ndarray, "modules modules"]:
    """Second derivative of an even hanging chain's potential by its modules' bends; its largest number is one."""
    along = (np.arange(modules * points) + 0.5) / points
    slopes = np.clip(along[:, None] - np.arange(modules), 0.0, 1.0)
    shape = np.einsum("s,sj,sk->jk", modules - along, slopes, slopes)
    return shape / shape.max()


def settled_bends(
    guess: Guess,
    wiring: Wiring,
    columns: Float[Array | np.ndarray, "rows drives"],
    tension: bool,
) -> Float[Array, "rows modules 2"]:
    """Bends [rad] at which the arm rests, differentiable: which cables are slack is found first, then held."""
    ways = directions(guess, wiring)
    own = stiffness_of(guess)
    pulls = (
        wiring.sign * (jnp.exp(guess.gain + guess.gains) * columns)[:, wiring.drive]
        - guess.offsets[wiring.drive]
    )
    taut = jnp.ones_like(pulls)
    if tension:
        return jnp.linalg.solve(own, (pulls @ ways).T).T.reshape(len(columns), -1, 2)
    ways_held, own_held, pulls_held = (
        jax.lax.stop_gradient(one) for one in (ways, own, pulls)
    )

    def again(_, taut):
        return (
            pulls_held > _held(taut, ways_held, own_held, pulls_held) @ ways_held.T
        ).astype(pulls.dtype)

    taut = jax.lax.fori_loop(0, SETTLED, again, taut)
    bends = _held(taut, ways_held, own_held, pulls_held)
    inverse = jnp.linalg.inv(
        own_held + jnp.einsum("rc,ci,cj->rij", taut, ways_held, ways_held)
    )
    left = (
        taut * (pulls - bends @ ways.T)
    ) @ ways - bends @ own  # zero in value: it carries the slopes, at little cost
    return (bends + jnp.einsum("rij,rj->ri", inverse, left)).reshape(
        len(columns), -1, 2
    )


def _held(taut, ways, own, pulls):
    """Bends at which the arm rests on its taut cables."""
    whole = own + jnp.einsum("rc,ci,cj->rij", taut, ways, ways)
    return jnp.linalg.solve(whole, ((taut * pulls) @ ways)[..., None])[..., 0]


def turned(tilt: Numbers) -> Float[Array, "3 3"]:
    """A small rotation about x and y, as a Cayley transform."""
    across = jnp.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]) * tilt[1]
    across = (
        across
        + jnp.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]) * tilt[0]
    )
    return jnp.linalg.solve(jnp.eye(3) - across / 2, jnp.eye(3) + across / 2)


def model_states(
    guess: Guess, bends: Float[Array, "rows modules 2"]
) -> Float[Array, "rows modules 6"]:
    """States in the base frame."""
    return states_from_bends(bends, jnp.exp(guess.lengths))


def seen_states(
    guess: Guess, states: Float[Array, "rows modules 6"], frame: Float[Array, "3 3"]
):
    """The same in the frame of the file; columns of `frame` are the axes of the untilted base frame there."""
    rotation = frame @ turned(guess.tilt)
    return jnp.concatenate(
        [states[..., :3] @ rotation.T + guess.base, states[..., 3:] @ rotation.T],
        axis=-1,
    )
