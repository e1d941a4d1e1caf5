"""Program that fills the solid of a mesh with voxels; `meshes` runs it."""

import io
import sys
from pathlib import Path

import numpy as np
import scipy

from s2c2a.execution.child import limit_memory


def main(file: str, resolution: str, out: str) -> None:
    """Write the centers of the voxels, their distances from outside, and the solid's extents."""
    limit_memory()
    path = Path(file)
    try:
        import trimesh  # noqa: PLC0415  # an extra
    except ImportError:
        sys.exit("needs the package trimesh: pip install 's2c2a[meshes]'")
    # without its path, so that it leads to no other files
    mesh = trimesh.load_mesh(io.BytesIO(path.read_bytes()), path.suffix[1:].lower())
    if not len(mesh.faces) or not 0.0 < mesh.extents.max() < np.inf:
        sys.exit("holds no triangles that enclose a solid")
    pitch = float(mesh.extents.max()) / int(resolution)
    grid = mesh.voxelized(pitch).fill()
    padded = np.pad(grid.matrix, 1)
    depths = scipy.ndimage.distance_transform_edt(padded)[1:-1, 1:-1, 1:-1]
    # a voxel at the surface reaches half an edge inward
    np.savez(out, grid.points, pitch * (depths[grid.matrix] - 0.5), mesh.extents)


if __name__ == "__main__":
    main(*sys.argv[1:])
