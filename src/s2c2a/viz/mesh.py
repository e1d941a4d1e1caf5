"""Triangle mesh of an arm's surface, computed from `States` alone.

The mesh consists of tubes. A tube is a run of sections, a section is an outline in a
plane across the arm. Each section follows the frames of the base and of the module ends
with constant weights. The replay page gets these weights once and then draws the arm at
any time from the frames.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import directions_at, hermite_weights
from s2c2a.spaces import AXIS, POSITION, States
from s2c2a.viz.arrays import PlanePoints, Points
from s2c2a.viz.colors import BASE, DISC, darker, module_colors
from s2c2a.viz.mounting import STEEP

# looks, on which nothing else depends; more corners are slow in a browser
AROUND = 20  # corners of a section
BODY_ROWS = 9  # sections of a module
COARSER = 2  # step between the corners and sections that the outline keeps
THREAD_SIDES = 3  # corners of a section of a cable or line

# radius as a multiple of the cable radius where the arm file states none
BODY = 1.12

# multiples of the module radius
DISC_RADIUS = 1.16
DISC_HALF_HEIGHT = 0.14
CABLE_DISTANCE = 1.03  # from the center line
CABLE_RADIUS = 0.04
CABLE_LIFT = 0.12  # see `Piece`
TIP_LIFT = 0.5  # see `Piece`
COLLAR = ((0.0, 2.0), (0.0, 1.4), (0.3, 1.4), (0.3, 1.0))  # heights and radii

PLATE_HEIGHT = 0.018  # of the base, as a share of the arm's length

Vertices = Float[np.ndarray, "vertices 3"]
Faces = Int[np.ndarray, "faces 3"]
ModuleFrames = Float[np.ndarray, "*batch modules+1 4 3"]
"""Position [m], x, y and z axis of the base and of every module end, base frame."""


def frames_of(states: States) -> ModuleFrames:
    """Frames of the base and of every module end; x is transported without twist."""
    axes = unit(np.asarray(states, float)[..., AXIS])
    frames = np.zeros((*axes.shape[:-2], axes.shape[-2] + 1, 4, 3))
    frames[..., 0, 1:, :] = np.eye(3)
    frames[..., 1:, 0, :] = states[..., POSITION]
    frames[..., 1:, 3, :] = axes
    for module in range(axes.shape[-2]):
        x = frames[..., module, 1, :]
        start = frames[..., module, 3, :]
        end = axes[..., module, :]
        cosine = np.sum(start * end, -1)
        share = np.sum(x * end, -1) / np.maximum(1.0 + cosine, 1e-9)
        frames[..., module + 1, 1, :] = x - share[..., None] * (start + end)
    frames[..., 1:, 2, :] = np.cross(frames[..., 1:, 3, :], frames[..., 1:, 1, :])
    return frames


@dataclass(frozen=True, eq=False)
class Piece:
    """Part of the mesh with one color.

    Attributes:
        name: "module", "cables", "discs", "tip" or "base".
        color: "#rrggbb".
        tubes: first row and end row in `ArmMesh.sections` of each tube.
        outlines: x and y as multiples of a section's radius, counterclockwise seen from
            the tip; one outline for each strand.
        lift: distance [m] by which a painter that sorts faces by depth moves the piece
            towards the eye, so that it covers what it lies on.
    """

    name: str
    color: str
    tubes: Sequence[tuple[int, int]]
    outlines: PlanePoints
    lift: float

    @cached_property
    def faces(self) -> Faces:
        """Triangles between the corners of this piece, facing outward."""
        strands, around, _ = self.outlines.shape
        faces = []
        corners = 0
        for first, end in self.tubes:
            faces.append(corners + tube_faces(strands, end - first, around))
            corners += strands * (end - first) * around
        return np.concatenate(faces)


class ArmMesh:
    """Mesh of one arm; its faces are constant, its corners follow the states.

    Attributes:
        sections: rows of module, weights of the frames at the module's start (position,
            z) and end (position, z), share of the module's length, radius [m]. The
            modules' own tubes come first.
        pieces: modules from the base, their cables, the discs between them, the disc at
            the tip, the base.
        outline_faces: faces of `outline`.
    """

    def __init__(self, arm: ArmSpec):
        """Build the mesh of an arm."""
        count = arm.module_count
        lengths = ArmGeometry.of(arm).lengths
        radii = [module.radius or BODY * module.cable_radius for module in arm.modules]
        runs = []
        for module, radius in enumerate(radii):
            body = [(share, 0.0, radius) for share in np.linspace(0, 1, BODY_ROWS)]
            runs.append(_sections(module, lengths[module], body))
        for module, radius in enumerate(radii):
            # sections of a disc at a module's end: share of length, offset [m], radius
            # [m]
            closed = module == count - 1
            wide = DISC_RADIUS * radius
            half = DISC_HALF_HEIGHT * radius
            disc = [
                (1.0, -half, radius),
                (1.0, -half, wide),
                (1.0, half, wide),
                (1.0, half, 0.0 if closed else radius),
            ]
            runs.append(_sections(module, lengths[module], disc))
        # the base plate with the collar that holds the arm
        collar = [(0.0, radii[0] * high, radii[0] * wide) for high, wide in COLLAR]
        bottom = -PLATE_HEIGHT * arm.length
        base = [(0.0, bottom, 0.0), (0.0, bottom, collar[0][2]), *collar]
        runs.append(_sections(0, lengths[0], base))
        self.sections = np.concatenate(runs)
        ends = np.cumsum([0, *map(len, runs)]).tolist()
        self.pieces = _pieces(arm, radii, list(pairwise(ends)))
        rings = count * len(range(0, BODY_ROWS, COARSER))
        self.outline_faces = tube_faces(1, rings, AROUND // COARSER)

    def vertices(self, states: States) -> list[Vertices]:
        """Corners of each piece [m], base frame.

        Args:
            states: end positions [m] and end axes, shape (modules, 6), base frame.
        """
        frames = frames_of(states)
        module = self.sections[:, 0].astype(int)
        share = self.sections[:, 5, None]
        radius = self.sections[:, 6, None, None]
        start = frames[module]
        end = frames[module + 1]
        knots = np.concatenate([start[:, [0, 3]], end[:, [0, 3]]], axis=1)
        centers = np.einsum("sk,skx->sx", self.sections[:, 1:5], knots)
        x = unit((1 - share) * start[:, 1] + share * end[:, 1])
        z = unit((1 - share) * start[:, 3] + share * end[:, 3])
        axes = radius * np.stack([x, np.cross(z, x)], axis=1)
        return [_corners(piece, centers, axes) for piece in self.pieces]

    def outline(self, vertices: Sequence[Vertices]) -> Vertices:
        """Coarse surface of all modules from base to tip, for ghosts and shadows."""
        modules = [
            corners
            for piece, corners in zip(self.pieces, vertices, strict=True)
            if piece.name == "module"
        ]
        rings = np.reshape(modules, (-1, BODY_ROWS, AROUND, 3))
        return rings[:, ::COARSER, ::COARSER].reshape(-1, 3)


def threads(lines: Points, radius: float) -> Vertices:
    """Corners of thin tubes along lines.

    Browsers without a graphics card draw these triangles far faster than wide lines.
    """
    tangents = unit(np.gradient(lines, axis=1))
    upright = np.abs(tangents[..., 2:]) >= STEEP
    reference = np.where(upright, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    normals = unit(np.cross(tangents, reference))
    axes = radius * np.stack([normals, np.cross(tangents, normals)], axis=-2)
    return (lines[:, :, None] + _TRIANGLE @ axes).reshape(-1, 3)


def tube_faces(strands: int, rings: int, around: int) -> Faces:
    """Triangles of tubes whose corners have the layout (strands, rings, around)."""
    strand, ring, corner = np.meshgrid(
        *map(np.arange, (strands, rings - 1, around)), indexing="ij"
    )
    first = (strand * rings + ring) * around
    a = first + corner
    b = first + (corner + 1) % around
    c = a + around
    d = b + around
    faces = np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, c], -1)])
    return faces.reshape(-1, 3)


def unit(vectors: Points) -> Points:
    """Vectors scaled to length one; zero stays zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


_CIRCLE = directions_at(2 * np.pi * np.arange(AROUND) / AROUND)[None]
# of a thread
_TRIANGLE = directions_at(2 * np.pi * np.arange(THREAD_SIDES) / THREAD_SIDES)


def _pieces(
    arm: ArmSpec, radii: Sequence[float], tubes: list[tuple[int, int]]
) -> tuple[Piece, ...]:
    """Pieces of an arm from the tubes of its modules, their discs, and the base."""
    count = arm.module_count
    colors = module_colors(count)
    modules = []
    cables = []
    for module, color, radius, tube in zip(
        arm.modules, colors, radii, tubes, strict=False
    ):
        centers = CABLE_DISTANCE * directions_at(np.deg2rad(module.cable_angles_deg))
        outlines = centers[:, None] + CABLE_RADIUS * _TRIANGLE
        lift = CABLE_LIFT * radius
        modules.append(Piece("module", color, [tube], _CIRCLE, 0.0))
        cables.append(Piece("cables", darker(color), [tube], outlines, lift))
    pieces = modules + cables
    if count > 1:
        pieces.append(Piece("discs", DISC, tubes[count : 2 * count - 1], _CIRCLE, 0.0))
    pieces.append(Piece("tip", DISC, [tubes[-2]], _CIRCLE, TIP_LIFT * radii[-1]))
    pieces.append(Piece("base", BASE, [tubes[-1]], _CIRCLE, 0.0))
    return tuple(pieces)


def _sections(
    module: int, length: float, profile: list[tuple[float, float, float]]
) -> Float[np.ndarray, "sections 7"]:
    """Rows of `ArmMesh.sections` for a profile; offsets run along the frame's axis."""
    share, offset, radius = np.transpose(profile)
    start, slope, end, end_slope = hermite_weights(share)
    slope = slope * length + offset * (1 - share)
    end_slope = end_slope * length + offset * share
    modules = np.full(len(profile), module)
    columns = [modules, start, slope, end, end_slope, share, radius]
    return np.stack(columns, axis=-1)


def _corners(piece: Piece, centers: np.ndarray, axes: np.ndarray) -> Vertices:
    """Corners of a piece's tubes, from the centers and scaled axes of all sections."""
    corners = []
    for first, end in piece.tubes:
        offsets = piece.outlines[:, None] @ axes[first:end]
        corners.append((centers[first:end, None] + offsets).reshape(-1, 3))
    return np.concatenate(corners)
