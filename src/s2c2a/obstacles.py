"""Obstacles: solids that an arm keeps away from, as rows of numbers.

An obstacle is everything within a distance, its threshold r, of a core. One kind of core
serves all solids: a box that a disc, which lies across the box's z axis, rounds. A point
makes a sphere, a segment a capsule, a disc and a segment a cylinder, a large box a
half-space. Chen et al. 2025, eq. (5), has points.
"""

from typing import Any

import numpy as np
from jaxtyping import Float

ROW = 12
"""Numbers of an obstacle: its center, its threshold and its core."""
CENTER, THRESHOLD, CORE = slice(0, 3), 3, slice(4, ROW)
TURN, HALF_EDGES, DISC = slice(0, 4), slice(4, 7), 7
"""Numbers of a core: a unit quaternion (x, y, z, w; zeros: not turned), half the edges of
the box and the radius of the disc [m]."""

Lengths = Float[Any, "*batch"]
Vectors = Float[Any, "*batch 3"]
Cores = Float[Any, "*batch 8"]
Row = Float[np.ndarray, "12"]
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


def distances(points: Vectors, centers: Vectors, cores: Cores) -> Lengths:
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


def turned(vectors: Vectors, axes: Vectors, last: Float[Any, "*batch 1"]) -> Vectors:
    """Vectors turned by unit quaternions, given as their first three numbers and their last."""
    xp = vectors.__array_namespace__()
    half = xp.cross(axes, vectors)
    return vectors + 2.0 * (last * half + xp.cross(axes, half))


def is_sphere(row: Row) -> bool:
    """Whether a row is that of a sphere."""
    return not row[CORE][HALF_EDGES].any() and row[CORE][DISC] == 0.0


def is_half_space(row: Row) -> bool:
    """Whether a row is that of a half-space."""
    return bool(row[CORE][HALF_EDGES].min() >= HALF_SPACE)


def normal_of(half_space: Row) -> Float[np.ndarray, "3"]:
    """Unit vector out of a half-space, given as the row of its large cube."""
    turn = half_space[CORE][TURN]
    axis = turned(np.array([0.0, 0.0, 1.0]), turn[:3], turn[3:])
    return axis if axis @ half_space[CENTER] < 0.0 else -axis


def turns_to(directions: Vectors) -> Float[Any, "*batch 4"]:
    """Unit quaternions that turn the z axis into directions, or opposite to them.

    A zero vector is taken as the z axis.
    """
    xp = directions.__array_namespace__()
    is_zero = xp.all(directions == 0.0, axis=-1, keepdims=True)
    given = xp.where(is_zero, xp.asarray([0.0, 0.0, 1.0]), directions)
    upward = xp.where(given[..., 2:] < 0.0, -given, given)
    lengths = xp.linalg.vector_norm(upward, axis=-1)
    x, y, z = xp.moveaxis(upward, -1, 0)
    turns = xp.stack([-y, x, 0.0 * z, z + lengths], axis=-1)
    return turns / xp.linalg.vector_norm(turns, axis=-1, keepdims=True)


def swept(thresholds: Lengths, cores: Cores, ways: Vectors) -> tuple[Lengths, Cores]:
    """Thresholds [m] and cores of obstacles that cover their ways, from the middles of these.

    Spheres become capsules. Other solids are larger by half of their ways, all around.
    A threshold of zero stays: nothing is there.

    Args:
        thresholds: [m]; NumPy or JAX, as all.
        cores: see `TURN`.
        ways: [m].
    """
    xp = ways.__array_namespace__()
    halves = xp.linalg.vector_norm(ways, axis=-1) / 2.0
    is_sphere = ~xp.any(cores != 0.0, axis=-1)
    grows = (thresholds > 0.0) & ~is_sphere
    sizes = xp.stack([0.0 * halves, 0.0 * halves, halves, 0.0 * halves], axis=-1)
    rods = xp.concat([turns_to(ways), sizes], axis=-1)
    is_rod = is_sphere & (halves > 0.0)
    return (
        xp.where(grows, thresholds + halves, thresholds),
        xp.where(is_rod[..., None], rods, cores),
    )


def _outside(excess: Float[Any, "*batch 2"]) -> Lengths:
    """Signed distance from a corner, from how far each axis exceeds it.

    The gradient at the corner is zero.
    """
    xp = excess.__array_namespace__()
    squared = xp.sum(xp.maximum(excess, 0.0) ** 2, axis=-1)
    is_outside = squared > 0.0
    distance = xp.sqrt(xp.where(is_outside, squared, 1.0))
    # no `max`: its slope is that of the entries that equal it, of which there is none where
    # a compiler computes them twice, and rounds differently
    one, other = xp.moveaxis(excess, -1, 0)
    return xp.where(is_outside, distance, xp.where(one > other, one, other))
