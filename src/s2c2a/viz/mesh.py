"""The arm's surface: tubes along the center line, from States alone; the same for films and pages.

A tube is a run of sections; a section is an outline in a plane across the arm. Where a
section is follows from the frames at the base and at the modules' ends by weights that
never change, so that a page which is told them once needs nothing but the frames to
draw the arm at any time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import center_line as line_to_tip
from s2c2a.arm.geometry import hermite_weights
from s2c2a.spaces import AXIS, POSITION, States
from s2c2a.viz.colors import BASE, DISC, darker, module_colors

AROUND = 20
BODY_ROWS = 9  # sections of a module
COARSER = 2  # of the outline, both ways
# radius of the body as a share of the cable radius; an arm file does not state it
BODY = 1.12
# radius and half height of a disc as shares of the body's radius
DISC_WIDE = 1.16
DISC_HALF = 0.14
# the cables' distance from the center line and their radius, the same
CABLE_OFF = 1.03
CABLE_THICK = 0.04
# see `Piece`, the same
CABLE_LIFT = 0.12
TIP_LIFT = 0.5
PLATE = 0.018  # height of the base's plate in parts of the arm's length
# of the base: height and radius, in parts of the body's
COLLAR = ((0.0, 2.0), (0.0, 1.4), (0.3, 1.4), (0.3, 1.0))
THREAD_SIDES = 3

Vertices = Float[np.ndarray, "vertices 3"]
Faces = Int[np.ndarray, "faces 3"]
Frames = Float[np.ndarray, "*batch modules+1 4 3"]
"""Position [m], x, y and z axis of the base and of every module's end, base frame."""


def frames_of(states: States) -> Frames:
    """Frames at the base and at every module's end; x is carried from each to the next without twist."""
    axes = unit(np.asarray(states, float)[..., AXIS])
    frames = np.zeros((*axes.shape[:-2], axes.shape[-2] + 1, 4, 3))
    frames[..., 0, 1:, :] = np.eye(3)
    frames[..., 1:, 0, :] = states[..., POSITION]
    frames[..., 1:, 3, :] = axes
    for module in range(axes.shape[-2]):
        x = frames[..., module, 1, :]
        before = frames[..., module, 3, :]
        after = axes[..., module, :]
        share = np.sum(x * after, -1) / np.maximum(
            1.0 + np.sum(before * after, -1), 1e-9
        )
        frames[..., module + 1, 1, :] = x - share[..., None] * (before + after)
    frames[..., 1:, 2, :] = np.cross(frames[..., 1:, 3, :], frames[..., 1:, 1, :])
    return frames


def center_line(
    states: States, lengths: Float[np.ndarray, " modules"], points_per_module: int = 16
) -> Float[np.ndarray, "*batch points 3"]:
    """The arm's center line [m] with the base as its first point, base frame; for drawing, not for kinematics.

    Args:
        states: end positions [m] and end axes, shape (*batch, modules, 6), base frame.
        lengths: module lengths [m], shape (modules,).
        points_per_module: points on each module after its first.
    """
    states = np.asarray(states, dtype=float)
    points = line_to_tip(states, np.asarray(lengths, dtype=float), points_per_module)
    return np.concatenate([np.zeros((*states.shape[:-2], 1, 3)), points], axis=-2)


@dataclass(frozen=True, eq=False)
class Piece:
    """What is drawn in one color and may move in one.

    Attributes:
        name: what it is: module, cables, discs, tip or base.
        color: of it.
        tubes: first and last but one row in `ArmMesh.sections` of each tube that it
            consists of.
        outlines: x and y in parts of a section's radius, counterclockwise seen from the
            tip; one for each strand.
        lift: how much nearer to the eye than it is a painter without depth takes it, so
            that it is painted after what it lies on [m].
    """

    name: str
    color: str
    tubes: Sequence[tuple[int, int]]
    outlines: Float[np.ndarray, "strands around 2"]
    lift: float = 0.0

    @cached_property
    def faces(self) -> Faces:
        """Triangles between `ArmMesh.vertices` of this piece, facing outward."""
        strands, around, _ = self.outlines.shape
        firsts = (
            strands
            * around
            * np.cumsum([0, *(last - first for first, last in self.tubes)])
        )
        every = zip(firsts, self.tubes, strict=False)
        return np.concatenate(
            [
                start + tube_faces(strands, last - first, around)
                for start, (first, last) in every
            ]
        )


class ArmMesh:
    """Skins the states of one arm; the faces never change, only where their corners are.

    Attributes:
        sections: rows of module, weights of the frames at its start (position, z) and
            end (position, z), share of its way, radius [m]; first those of the modules'
            tubes.
        pieces: the modules, base first, their cables, the discs between them, the disc
            at the tip, the base.
        outline_faces: of `outline`.
    """

    def __init__(self, arm: ArmSpec):
        """The surface of an arm."""
        colors = module_colors(arm.module_count)
        count = arm.module_count
        lengths = ArmGeometry.of(arm).lengths
        radii = BODY * ArmGeometry.of(arm).cable_radii
        bodies = [
            [(share, 0.0, radius) for share in np.linspace(0, 1, BODY_ROWS)]
            for radius in radii
        ]
        discs = [_disc(radius, closed=k == count - 1) for k, radius in enumerate(radii)]
        runs = [
            _sections(k % count, lengths[k % count], places)
            for k, places in enumerate([*bodies, *discs])
        ]
        runs.append(_sections(0, lengths[0], _base(radii[0], arm.length)))
        self.sections = np.concatenate(runs)
        tubes = list(pairwise(np.cumsum([0, *map(len, runs)]).tolist()))
        eyes = [_cable_outlines(module.cable_angles_deg) for module in arm.modules]
        self.pieces = (
            *(Piece("module", colors[k], [tubes[k]], _CIRCLE) for k in range(count)),
            *(
                Piece(
                    "cables",
                    darker(colors[k]),
                    [tubes[k]],
                    eyes[k],
                    CABLE_LIFT * radii[k],
                )
                for k in range(count)
            ),
            *(
                [Piece("discs", DISC, tubes[count : 2 * count - 1], _CIRCLE)]
                if count > 1
                else []
            ),
            Piece("tip", DISC, [tubes[-2]], _CIRCLE, TIP_LIFT * radii[-1]),
            Piece("base", BASE, [tubes[-1]], _CIRCLE),
        )
        self.outline_faces = tube_faces(
            1, count * len(range(0, BODY_ROWS, COARSER)), AROUND // COARSER
        )

    def vertices(self, states: States) -> list[Vertices]:
        """Corners of each piece [m] where the modules end in these states, shape (modules, 6); base frame."""
        frames = frames_of(states)
        module = self.sections[:, 0].astype(int)
        share = self.sections[:, 5, None]
        ends = np.concatenate(
            [frames[module][:, [0, 3]], frames[module + 1][:, [0, 3]]], axis=1
        )
        centers = np.einsum("sk,skx->sx", self.sections[:, 1:5], ends)
        z, x = (
            unit((1 - share) * frames[module, axis] + share * frames[module + 1, axis])
            for axis in (3, 1)
        )
        axes = self.sections[:, 6, None, None] * np.stack([x, np.cross(z, x)], axis=1)
        return [_corners(piece, centers, axes) for piece in self.pieces]

    def outline(self, vertices: Sequence[Vertices]) -> Vertices:
        """The whole body in one, for ghosts and shadows: base to tip, with a quarter of the corners."""
        modules = [
            corners
            for piece, corners in zip(self.pieces, vertices, strict=True)
            if piece.name == "module"
        ]
        return np.reshape(modules, (-1, BODY_ROWS, AROUND, 3))[
            :, ::COARSER, ::COARSER
        ].reshape(-1, 3)


def threads(lines: Float[np.ndarray, "lines points 3"], radius: float) -> Vertices:
    """Thin tubes along lines, as triangles: browsers without a graphics card draw them far faster than wide lines."""
    tangents = unit(np.gradient(lines, axis=1))
    aside = unit(
        np.cross(
            tangents,
            np.where(np.abs(tangents[..., 2:]) < 0.7, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)),
        )
    )
    axes = radius * np.stack([aside, np.cross(tangents, aside)], axis=-2)
    return (lines[:, :, None] + _TRIANGLE @ axes).reshape(-1, 3)


def tube_faces(strands: int, rings: int, around: int) -> Faces:
    """Triangles of tubes whose corners are laid out as (strands, rings, around)."""
    strand, ring, turn = np.meshgrid(
        *map(np.arange, (strands, rings - 1, around)), indexing="ij"
    )
    first = (strand * rings + ring) * around
    a = first + turn
    b = first + (turn + 1) % around
    c = a + around
    d = b + around
    return np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, c], -1)]).reshape(
        -1, 3
    )


def _circle(turns: np.ndarray) -> Float[np.ndarray, "points 2"]:
    return np.stack([np.cos(turns), np.sin(turns)], axis=-1)


_CIRCLE = _circle(2 * np.pi * np.arange(AROUND) / AROUND)[None]
_TRIANGLE = _circle(2 * np.pi * np.arange(THREAD_SIDES) / THREAD_SIDES)


def _cable_outlines(
    angles_deg: Sequence[float],
) -> Float[np.ndarray, "cables around 2"]:
    return (
        CABLE_OFF * _circle(np.deg2rad(angles_deg))[:, None] + CABLE_THICK * _TRIANGLE
    )


def _disc(radius: float, closed: bool) -> list[tuple[float, float, float]]:
    """A ring round a module's end: shares of the module's way, how far beyond, and radii [m]."""
    wide = DISC_WIDE * radius
    half = DISC_HALF * radius
    return [
        (1.0, -half, radius),
        (1.0, -half, wide),
        (1.0, half, wide),
        (1.0, half, 0.0 if closed else radius),
    ]


def _base(radius: float, length: float) -> list[tuple[float, float, float]]:
    """A plate on which a collar holds the arm, as `_disc` says it."""
    collar = [(0.0, radius * height, radius * wide) for height, wide in COLLAR]
    return [(0.0, -PLATE * length, 0.0), (0.0, -PLATE * length, collar[0][2]), *collar]


def _sections(module: int, length: float, places) -> Float[np.ndarray, "sections 7"]:
    """Rows of `ArmMesh.sections` for places as `_disc` says them; what is beyond an end goes on along its axis."""
    share, beyond, radius = np.transpose(places)
    start, slope, end, end_slope = hermite_weights(share)
    slope = slope * length + beyond * (1 - share)
    end_slope = end_slope * length + beyond * share
    return np.stack(
        [np.full(len(places), module), start, slope, end, end_slope, share, radius],
        axis=-1,
    )


def _corners(piece: Piece, centers: np.ndarray, axes: np.ndarray) -> Vertices:
    tubes = (slice(*tube) for tube in piece.tubes)
    every = [
        (centers[tube, None] + piece.outlines[:, None] @ axes[tube]).reshape(-1, 3)
        for tube in tubes
    ]
    return np.concatenate(every)


def unit(vectors: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 3"]:
    """Vectors of length one; zero stays zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
