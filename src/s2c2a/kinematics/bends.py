"""Bend vectors and configurations: two coordinates of the same module shape.

A bend b is the bending angle times its direction [rad], in the module's frame; a
configuration o is the module's end axis there. Both maps are exact at zero bend and
have exact gradients there.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

Limits = Float[Array, "*batch"] | float

# squared angle below which series replace quotients; the next term is below float32's
# resolution
_SMALL = 1e-6


def sinc(squared: Float[Array, "*batch"]) -> Float[Array, "*batch"]:
    """sin(f) / f as a function of f^2."""
    small = squared < _SMALL
    angle = jnp.sqrt(jnp.where(small, 1.0, squared))
    return jnp.where(small, 1.0 - squared / 6.0, jnp.sin(angle) / angle)


def squared_norm(vectors: Float[Array, "*batch axis"]) -> Float[Array, "*batch"]:
    """Sum of squares over the last axis."""
    return jnp.sum(vectors**2, axis=-1)


def configurations_from_bends(
    bends: Float[Array, "*batch 2"],
) -> Float[Array, "*batch 3"]:
    """O = (b sin f / f, cos f) with f = |b| (Chen et al. 2025, eq. (3), for any direction).

    Args:
        bends: bend vectors [rad], module frame.

    Returns:
        Unit end axes, module frame.
    """
    squared = squared_norm(bends)
    half = sinc(squared / 4.0)
    across = bends * sinc(squared)[..., None]
    along = 1.0 - squared * half**2 / 2.0  # cos f without its loss of digits near zero
    return jnp.concatenate([across, along[..., None]], axis=-1)


def bends_from_configurations(
    configurations: Float[Array, "*batch 3"],
) -> Float[Array, "*batch 2"]:
    """B = f o_xy / |o_xy| with f = atan2(|o_xy|, o_z): the inverse of `configurations_from_bends`.

    The length of the axis does not matter. Straight back (f = pi) has no direction and
    is not in the domain.

    Args:
        configurations: end axes of any non-zero length, module frame.

    Returns:
        Bend vectors [rad], module frame.
    """
    unit = configurations / jnp.sqrt(squared_norm(configurations))[..., None]
    across = unit[..., :2]
    along = unit[..., 2]
    squared = squared_norm(across)
    small = (squared < _SMALL) & (along > 0.0)
    sine = jnp.sqrt(jnp.where(small, 1.0, squared))
    ratio = jnp.where(small, 1.0 + squared / 6.0, jnp.arctan2(sine, along) / sine)
    return across * ratio[..., None]


def limit_lengths(
    vectors: Float[Array, "*batch axis"], limits: Limits
) -> Float[Array, "*batch axis"]:
    """Shorten every vector that is longer than its limit; directions stay."""
    squared = squared_norm(vectors)
    inside = squared <= limits**2
    return (
        vectors
        * jnp.where(inside, 1.0, limits / jnp.sqrt(jnp.where(inside, 1.0, squared)))[
            ..., None
        ]
    )
