"""Surfaces of obstacles, to be drawn: points whose convex hull is the solid."""

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from s2c2a.obstacles import (
    CENTER,
    CORE,
    DISC,
    HALF_EDGES,
    HALF_SPACE,
    THRESHOLD,
    TURN,
    Row,
    is_half_space,
    normal_of,
    turned,
)

# chosen: circles look round; none is along an axis, where a box has no one corner
AZIMUTHS = np.deg2rad(np.arange(7.5, 360.0, 15.0))
ELEVATIONS = np.deg2rad([-89.0, -60.0, -30.0, -1.0, 1.0, 30.0, 60.0, 89.0])
SLAB = 0.02  # of what is shown of a half-space: its thickness
Points = Float[np.ndarray, "points 3"]


def surface(row: Row, shown: float) -> Points:
    """Points of the surface [m], base frame.

    Args:
        row: of an obstacle (`s2c2a.obstacles`).
        shown: half the edge of the part of a half-space that is drawn [m].
    """
    center, core = row[CENTER], row[CORE]
    half_edges = core[HALF_EDGES]
    turn = core[TURN]
    if is_half_space(row):
        normal = normal_of(row)
        level = normal @ center + HALF_SPACE
        half_edges = shown * np.array([1.0, 1.0, SLAB])
        center = (level - half_edges[2]) * normal
    # unit vectors all around
    azimuths, elevations = map(np.ravel, np.meshgrid(AZIMUTHS, ELEVATIONS))
    flat = np.cos(elevations)
    directions = np.column_stack(
        [flat * np.cos(azimuths), flat * np.sin(azimuths), np.sin(elevations)]
    )
    across = directions * [1.0, 1.0, 0.0]
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    corners = np.sign(directions) * half_edges + core[DISC] * across
    local = corners + row[THRESHOLD] * directions
    return center + turned(local, turn[:3], turn[3:])


def outline(points: Float[np.ndarray, "points 2"]) -> Float[np.ndarray, "corners 2"]:
    """Corners of the convex hull of points in a plane; none if they lie on a line."""
    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points[:0]


def hull(points: Points) -> tuple[Points, np.ndarray]:
    """The points, and the triangles of their convex hull, seen from outside against the clock."""
    found = ConvexHull(points)
    triangles = found.simplices.copy()
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    is_inward = np.sum(np.cross(b - a, c - a) * found.equations[:, :3], axis=1) < 0.0
    triangles[is_inward] = triangles[is_inward, ::-1]
    return points, triangles
