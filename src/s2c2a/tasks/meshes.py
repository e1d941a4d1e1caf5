"""Solids that files of triangles enclose, covered by spheres.

The solid is filled with voxels, of which each knows its distance from the outside. A
sphere around a voxel with this radius lies within the solid; a little larger ones cover
it. The fewer spheres are allowed, the farther they stand out.
"""

from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.errors import TargetError, counted
from s2c2a.execution.child import ChildError, arrays_of_child

RESOLUTION = 32  # voxels along the longest edge; chosen: a sphere of them takes 0.3 s
BISECTIONS = 10  # of how far spheres stand out: to a thousandth of the solid
PROGRAM = str(Path(__file__).with_name("mesh_program.py"))
FORMATS = ".stl", ".obj", ".ply", ".glb", ".off"
Spheres = Float[np.ndarray, "spheres 4"]


class Cover(NamedTuple):
    """Spheres whose union contains a solid.

    Attributes:
        spheres: centers and radii, shape (spheres, 4).
        excess: by how much they stand out at most.
        edges: of the box around the solid, along x, y and z.
    """

    spheres: Spheres
    excess: float
    edges: Float[np.ndarray, "3"]


@lru_cache(maxsize=32)
def covering_spheres(file: Path, most: int) -> Cover:
    """Spheres that cover the solid of a mesh, in the unit of the file.

    They stand out as little as so many spheres allow.

    Args:
        file: of triangles.
        most: number of spheres.

    Raises:
        TargetError: the file is missing, cannot be read, takes too much memory, or holds
            no triangles, or the package `trimesh` is missing.
    """
    if not file.is_file() or file.suffix.lower() not in FORMATS:
        raise TargetError(
            f"no mesh {file}; give a file of triangles ({', '.join(FORMATS)}) beside the "
            "scene file"
        )
    try:
        centers, depths, edges = arrays_of_child(PROGRAM, str(file), str(RESOLUTION))
    except ChildError as error:
        raise TargetError(
            f"the mesh {file} cannot be used: {error}. Spheres cover it coarsely: a mesh of "
            "few triangles does"
        ) from error
    pitch = float(edges.max()) / RESOLUTION
    low, high = 0.0, 2.0 * RESOLUTION * pitch
    best = _cover(centers, depths + high, pitch, most)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2.0
        found = _cover(centers, depths + middle, pitch, most)
        low, high = (middle, high) if found is None else (low, middle)
        best = best if found is None else found
    if best is None:
        raise TargetError(
            f"{file} cannot be covered by {counted(most, 'sphere')}; allow more"
        )
    return Cover(best, high + pitch, edges)


def _cover(
    centers: Float[np.ndarray, "voxels 3"],
    radii: Float[np.ndarray, " voxels"],
    pitch: float,
    most: int,
) -> Spheres | None:
    """Spheres around voxels that contain all of them: the largest of those left, in turn.

    Args:
        centers: of the voxels.
        radii: of the spheres around each.
        pitch: edge of a voxel.
        most: number of spheres.

    Returns:
        None if more are needed.
    """
    reaches = radii - np.sqrt(3.0) / 2.0 * pitch  # to the corners of covered voxels
    is_bare = np.ones(len(radii), bool)
    chosen: list[int] = []
    while is_bare.any():
        largest = int(np.argmax(np.where(is_bare, radii, -np.inf)))
        if len(chosen) == most or reaches[largest] < 0.0:
            return None
        distances = np.linalg.norm(centers - centers[largest], axis=1)
        is_bare &= distances > reaches[largest]
        chosen.append(largest)
    return np.column_stack([centers[chosen], radii[chosen]])
