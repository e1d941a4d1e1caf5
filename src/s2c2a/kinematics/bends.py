"""Bend vectors and configurations: two coordinates of the same module shape.

A bend b is the bending angle times its direction [rad], in the module's frame; a
configuration o is the module's end axis there. Both maps are exact at zero bend and
have exact gradients there.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

Numbers = Array | np.ndarray
"""What functions of JAX take; they return arrays of JAX."""
Values = Float[Array, "*batch"]
Scalar = Float[Array, ""]
Truth = Bool[Array, ""]
FlatBends = Float[Array, " bends"]
"""Bends of all modules, one after the other."""
Vectors = Float[Numbers, "*batch axis"]
BendLimits = Float[Numbers, "*#batch"] | float

# Squared angle below which series replace quotients; the next term of the series is
# below the resolution of float32.
SMALL_SQUARE = 1e-6


def sinc(squared: Float[Numbers, "*batch"]) -> Values:
    """Return sin(f) / f as a function of f^2."""
    small = squared < SMALL_SQUARE
    angle = jnp.sqrt(jnp.where(small, 1.0, squared))
    return jnp.where(small, 1.0 - squared / 6.0, jnp.sin(angle) / angle)


def squared_norm(vectors: Vectors) -> Values:
    """Return the sum of squares over the last axis."""
    return jnp.sum(vectors**2, axis=-1)


def norm(vectors: Vectors) -> Values:
    """Return the Euclidean norm over the last axis, with gradient zero at zero."""
    squared = squared_norm(jnp.asarray(vectors))
    zero = squared == 0.0
    return jnp.where(zero, 0.0, jnp.sqrt(jnp.where(zero, 1.0, squared)))


def configurations_from_bends(
    bends: Float[Numbers, "*batch 2"],
) -> Float[Array, "*batch 3"]:
    """Return o = (b sin f / f, cos f) with f = |b|.

    This is eq. (3) of Chen et al. 2025, for any direction.

    Args:
        bends: bend vectors [rad], module frame.

    Returns:
        Unit end axes, module frame.
    """
    squared = squared_norm(bends)
    half = sinc(squared / 4.0)
    lateral = bends * sinc(squared)[..., None]
    # cos f, without its loss of digits near zero
    axial = 1.0 - squared * half**2 / 2.0
    return jnp.concatenate([lateral, axial[..., None]], axis=-1)


def bends_from_cables(
    inverses: Float[Array, "modules 2 cables"],
    cables: Float[Numbers, "*batch modules cables"],
) -> Float[Array, "*batch modules 2"]:
    """Return the bends that cables hold, which common motion does not change.

    Args:
        inverses: of each module's cable directions (`ArmGeometry.bend_matrices`), in
            any unit.
        cables: displacements, tensions or shares, in the unit of the inverses.
    """
    return jnp.einsum("mkc,...mc->...mk", inverses, cables)


def bends_from_configurations(
    configurations: Float[Numbers, "*batch 3"],
) -> Float[Array, "*batch 2"]:
    """Return b = f o_xy / |o_xy| with f = atan2(|o_xy|, o_z).

    This is the inverse of `configurations_from_bends`. The length of the axis has no
    influence. The axis straight back (f = pi) has no direction and is not in the
    domain.

    Args:
        configurations: end axes of any non-zero length, module frame.

    Returns:
        Bend vectors [rad], module frame.
    """
    unit = configurations / jnp.sqrt(squared_norm(configurations))[..., None]
    lateral = unit[..., :2]
    axial = unit[..., 2]
    squared = squared_norm(lateral)
    small = (squared < SMALL_SQUARE) & (axial > 0.0)
    sine = jnp.sqrt(jnp.where(small, 1.0, squared))
    ratio = jnp.where(small, 1.0 + squared / 6.0, jnp.arctan2(sine, axial) / sine)
    return jnp.multiply(lateral, ratio[..., None])


def commanded_part(
    bends: Float[Numbers, "*batch modules 2"],
    projectors: Float[Numbers, "modules 2 2"] | None,
) -> Float[Array, "*batch modules 2"]:
    """Return the part of bends that cables command (`ArmGeometry.steerable`)."""
    if projectors is None:
        return jnp.asarray(bends)
    return jnp.einsum("mij,...mj->...mi", projectors, bends)


def commanded_configurations(
    configurations: Float[Numbers, "*batch modules 3"],
    projectors: Float[Numbers, "modules 2 2"] | None,
) -> Float[Array, "*batch modules 3"]:
    """Return configurations of the directions that cables command, not of unit length."""
    lateral, axial = jnp.split(jnp.asarray(configurations), [2], axis=-1)
    return jnp.concatenate([commanded_part(lateral, projectors), axial], axis=-1)


def limit_lengths(vectors: Vectors, limits: BendLimits) -> Float[Array, "*batch axis"]:
    """Shorten every vector that is longer than its limit; directions stay."""
    squared = squared_norm(vectors)
    inside = squared <= limits**2
    lengths = jnp.sqrt(jnp.where(inside, 1.0, squared))
    scale = jnp.where(inside, 1.0, limits / lengths)
    return jnp.multiply(vectors, scale[..., None])
