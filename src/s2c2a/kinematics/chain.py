"""Forward kinematics of a chain of constant-curvature arcs, and its inverse."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import (
    Numbers,
    bends_from_configurations,
    configurations_from_bends,
    sinc,
    squared_norm,
)

Bends = Float[Numbers, "*batch modules 2"]
Lengths = Float[Numbers, "*#batch modules"]
Vectors = Float[Array, "*batch 3"]
States = Float[Array, "*batch modules 6"]


def states_from_bends(bends: Bends, lengths: Lengths) -> States:
    """Return the states of an arm whose modules are arcs without torsion.

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
    off: Float[Numbers, "... 3"],
    force: Float[Array, "3"] | None = None,
    lateral_compliances: Float[Array, " modules"] | None = None,
) -> States:
    """Return the states of arcs with displaced end points; see `states_from_bends`.

    Args:
        bends: bend vectors [rad], module frames.
        lengths: arc lengths [m].
        off: displacements of the end points [m], module frames.
        force: external force at the tip [N], base frame. Its component across an arc
            bends the proximal half more than the distal half.
        lateral_compliances: displacement of each end point per unit of that component
            [m/N].
    """
    # ends of arcs in their own frames: L (b (1 - cos f) / f^2, sin f / f)
    squared = squared_norm(bends)
    lateral = bends * (sinc(squared / 4.0) ** 2 / 2.0)[..., None]
    shares = jnp.concatenate([lateral, sinc(squared)[..., None]], axis=-1)
    ends = jnp.multiply(lengths[..., None], shares)
    axes = configurations_from_bends(bends)
    chords = ends / jnp.linalg.norm(ends, axis=-1, keepdims=True)
    batch = bends.shape[:-2]
    base = (jnp.zeros((*batch, 3)), jnp.broadcast_to(jnp.eye(3), (*batch, 3, 3)))

    def add_arc(base, arc):
        position, rotation = base
        end, chord, compliance, axis, arc_rotation = arc
        if force is not None:
            local = jnp.einsum("...ji,j->...i", rotation, force)
            along = chord * jnp.sum(local * chord, axis=-1, keepdims=True)
            end = end + compliance * (local - along)
        position = position + _rotate(rotation, end)
        state = jnp.concatenate([position, _rotate(rotation, axis)], axis=-1)
        return (position, rotation @ arc_rotation), state

    # lax.scan runs over the first axis: the modules.
    arcs = (
        jnp.moveaxis(ends + off, -2, 0),
        jnp.moveaxis(chords, -2, 0),
        jnp.zeros(bends.shape[-2])
        if lateral_compliances is None
        else lateral_compliances,
        jnp.moveaxis(axes, -2, 0),
        jnp.moveaxis(rotations_to(axes), -3, 0),
    )
    _, states = jax.lax.scan(add_arc, base, arcs)
    return jnp.moveaxis(states, 0, -2)


def states_from_configurations(
    configurations: Float[Numbers, "*batch modules 3"], lengths: Lengths
) -> States:
    """Return states for end axes of any non-zero length; see `states_from_bends`."""
    return states_from_bends(bends_from_configurations(configurations), lengths)


def configurations_from_states(states: Float[Numbers, "*batch modules 6"]):
    """Return the configurations of an arm without torsion that has these states.

    Args:
        states: base frame; only the end axes are used. NumPy or JAX, like the result.

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


def bends_from_states(
    states: Float[Numbers, "*batch modules 6"],
) -> Float[Array, "*batch modules 2"]:
    """Return the bend vectors [rad] of an arm without torsion that has these states.

    See `configurations_from_states`.
    """
    return bends_from_configurations(configurations_from_states(states))


def rotations_to(axes: Float[Numbers, "*batch 3"]):
    """Return the rotations without torsion that turn z into each axis."""
    x = axes[..., 0]
    y = axes[..., 1]
    z = axes[..., 2]
    share = 1.0 / (1.0 + z)
    xx = 1.0 - x * x * share
    xy = -x * y * share
    yy = 1.0 - y * y * share
    xp = axes.__array_namespace__()
    entries = xp.stack([xx, xy, x, xy, yy, y, -x, -y, z], axis=-1)
    return entries.reshape(*axes.shape[:-1], 3, 3)


def _rotate(rotation: Float[Array, "*batch 3 3"], vector: Vectors) -> Vectors:
    return jnp.einsum("...ij,...j->...i", rotation, vector)
