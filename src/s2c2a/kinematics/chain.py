"""The chain from module shapes to states: constant-curvature arcs, one after the other."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import (
    bends_from_configurations,
    configurations_from_bends,
    sinc,
    squared_norm,
)

UNROLLED = 8  # modules: a loop of its own only for longer arms
Bends = Float[Array, "*batch modules 2"]
Lengths = Float[Array, " modules"]
States = Float[Array, "*batch modules 6"]


def states_from_bends(bends: Bends, lengths: Lengths) -> States:
    """States of an arm whose modules are arcs without torsion.

    Args:
        bends: bend vectors [rad], module frames.
        lengths: arc lengths [m].

    Returns:
        End position [m] and end axis of every module, base frame.
    """
    return states_from_arcs(bends, lengths, jnp.zeros(3))


def states_from_arcs(
    bends: Bends,
    lengths: Lengths,
    off: Float[Array, "*#batch #modules 3"],
    force: Float[Array, "3"] | None = None,
    gives: Float[Array, " modules"] | None = None,
) -> States:
    """`states_from_bends` of arcs whose end points are off by so much [m], module frames.

    Args:
        bends: bend vectors [rad], module frames.
        lengths: arc lengths [m].
        off: of end points [m], module frames.
        force: at the tip [N], base frame; across an arc it bends the near half more
            than the far one.
        gives: how far that moves ends for a force of one [m/N].
    """
    ends = arc_ends(bends, lengths)
    axes = configurations_from_bends(bends)
    chords = ends / jnp.linalg.norm(ends, axis=-1, keepdims=True)
    rotations = rotations_to(axes)
    start = (
        jnp.zeros((*bends.shape[:-2], 3)),
        jnp.broadcast_to(jnp.eye(3), (*bends.shape[:-2], 3, 3)),
    )

    def on(base, arc):
        (position, rotation) = base
        (end, chord, give, axis, turn) = arc
        if force is not None:
            felt = jnp.einsum("...ji,j->...i", rotation, force)
            end = end + give * (
                felt - chord * jnp.sum(felt * chord, axis=-1, keepdims=True)
            )
        position = position + _rotate(rotation, end)
        state = jnp.concatenate([position, _rotate(rotation, axis)], axis=-1)
        return (position, rotation @ turn), state

    gives = jnp.zeros(bends.shape[-2]) if gives is None else gives
    arcs = (*(jnp.moveaxis(part, -2, 0) for part in (ends + off, chords)), gives)
    arcs = *arcs, jnp.moveaxis(axes, -2, 0), jnp.moveaxis(rotations, -3, 0)
    return jnp.moveaxis(jax.lax.scan(on, start, arcs, unroll=UNROLLED)[1], 0, -2)


def states_from_configurations(
    configurations: Float[Array, "*batch modules 3"], lengths: Lengths
) -> States:
    """`states_from_bends` for end axes of any non-zero length."""
    return states_from_bends(bends_from_configurations(configurations), lengths)


def configurations_from_states(states: Float[Array | np.ndarray, "*batch modules 6"]):
    """What the modules' configurations must be for given states of an arm without torsion.

    Args:
        states: only the end axes count; base frame. In NumPy or JAX, as the result then
            is.

    Returns:
        Unit end axes, module frames, shape (*batch, modules, 3).
    """
    xp = states.__array_namespace__()
    axes = states[..., 3:]
    rotation = xp.broadcast_to(xp.eye(3, dtype=axes.dtype), (*axes.shape[:-2], 3, 3))
    configurations = []
    for module in range(axes.shape[-2]):
        axis = xp.einsum("...ji,...j->...i", rotation, axes[..., module, :])
        configurations.append(axis / xp.linalg.norm(axis, axis=-1, keepdims=True))
        rotation = rotation @ rotations_to(configurations[-1])
    return xp.stack(configurations, axis=-2)


def bends_from_states(states: Float[Array, "*batch modules 6"]) -> Bends:
    """Bend vectors [rad] that the end axes of an arm without torsion stand for; see `configurations_from_states`."""
    return bends_from_configurations(configurations_from_states(states))


def arc_ends(
    bends: Float[Array, "*batch 2"], lengths: Float[Array, "*batch"]
) -> Float[Array, "*batch 3"]:
    """End of an arc in its own frame: L (b (1 - cos f) / f^2, sin f / f)."""
    squared = squared_norm(bends)
    across = bends * (sinc(squared / 4.0) ** 2 / 2.0)[..., None]
    return lengths[..., None] * jnp.concatenate(
        [across, sinc(squared)[..., None]], axis=-1
    )


def rotations_to(axes: Float[Array | np.ndarray, "*batch 3"]):
    """The rotation without torsion that turns z into each axis."""
    x = axes[..., 0]
    y = axes[..., 1]
    z = axes[..., 2]
    share = 1.0 / (1.0 + z)
    rows = [
        1.0 - x * x * share,
        -x * y * share,
        x,
        -x * y * share,
        1.0 - y * y * share,
        y,
        -x,
        -y,
        z,
    ]
    return (
        axes.__array_namespace__().stack(rows, axis=-1).reshape(*axes.shape[:-1], 3, 3)
    )


def _rotate(
    rotation: Float[Array, "*batch 3 3"], vector: Float[Array, "*batch 3"]
) -> Float[Array, "*batch 3"]:
    return jnp.einsum("...ij,...j->...i", rotation, vector)
