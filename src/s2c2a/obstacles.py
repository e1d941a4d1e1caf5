"""Obstacles: solids that an arm keeps away from, as rows of numbers.

An obstacle is everything within a distance, its threshold r, of a core. One kind of core
serves all solids: a box that a disc, which lies across the box's z axis, rounds. A point
makes a sphere, a segment a capsule, a disc and a segment a cylinder, a large box a
half-space. Chen et al. 2025, eq. (5), has points.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

CENTER, THRESHOLD = slice(0, 3), 3
CORE = slice(4, 12)
ROW = 12
"""Numbers of an obstacle: its center, its threshold and its core."""
TURN, HALF_EDGES, DISC = slice(0, 4), slice(4, 7), 7
"""Numbers of a core: a unit quaternion (x, y, z, w; zeros: not turned), half the edges of
the box and the radius of the disc [m]."""

Rows = Float[np.ndarray, "*batch obstacles 12"]
SKIN = 1e-4  # m; chosen: a threshold of zero is no obstacle, and nobody sees 0.1 mm
HALF_SPACE = 50.0  # m; half the edge of the cube that stands for one: beyond any arm


def rows_of(obstacles: Float[np.ndarray, "*batch obstacles columns"]) -> Rows:
    """Rows with cores, of rows that may be of spheres alone.

    Args:
        obstacles: with 4 columns (centers and thresholds), or 12.
    """
    missing = ROW - obstacles.shape[-1]
    return np.pad(obstacles, [(0, 0)] * (obstacles.ndim - 1) + [(0, missing)])


def distances(
    points: Float[Any, "*batch 3"],
    centers: Float[Any, "*batch 3"],
    cores: Float[Any, "*batch 8"],
) -> Float[Any, "*batch"]:
    """Signed distances of points from cores [m], negative inside boxes and discs.

    Args:
        points: [m]; NumPy, or JAX and then differentiable.
        centers: [m], in the same frame; arrays of either library, also below.
        cores: see `TURN`.
    """
    xp = points.__array_namespace__()
    local = turned(points - centers, -cores[..., :3], cores[..., 3:4])
    excess = xp.abs(local) - cores[..., HALF_EDGES]
    across = _outside(excess[..., :2]) - cores[..., DISC]
    return _outside(xp.stack([across, excess[..., 2]], axis=-1))


def turned(
    vectors: Float[Any, "*batch 3"],
    axes: Float[Any, "*batch 3"],
    last: Float[Any, "*batch 1"],
) -> Float[Any, "*batch 3"]:
    """Vectors turned by unit quaternions, given as their first three numbers and their last."""
    xp = vectors.__array_namespace__()
    half = xp.cross(*xp.broadcast_arrays(xp.asarray(axes), vectors))
    return vectors + 2.0 * (
        last * half + xp.cross(*xp.broadcast_arrays(xp.asarray(axes), half))
    )


def _outside(excess: Float[Any, "*batch axes"]) -> Float[Any, "*batch"]:
    """Signed distance from a corner, from how far each axis exceeds it.

    The gradient at the corner is zero.
    """
    xp = excess.__array_namespace__()
    squared = xp.sum(xp.maximum(excess, 0.0) ** 2, axis=-1)
    is_outside = squared > 0.0
    distance = xp.sqrt(xp.where(is_outside, squared, 1.0))
    return xp.where(is_outside, distance, xp.max(excess, axis=-1))
