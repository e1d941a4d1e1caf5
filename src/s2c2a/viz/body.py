"""The arm's body as triangles: tubes, discs and cables along the centre line, from States alone."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.spaces import States
from s2c2a.viz.shape import centre_line

AROUND = 20
RINGS = 8  # a module
COARSER = 2  # of the outline, both ways
BODY = 1.12  # radius of the body as a share of the cable radius; an arm file does not state it
DISC, DISC_HALF = 1.16, 0.12  # radius and half height of a disc as shares of the body's radius
CABLE, CABLE_THICK = 1.03, 0.05  # the cables' distance from the centre line and their radius, the same
THREAD_SIDES = 3

Vertices = Float[np.ndarray, "vertices 3"]
Faces = Int[np.ndarray, "faces 3"]


@dataclass(frozen=True)
class Shape:
    """Where the body's parts are.

    Attributes:
        modules: vertices of every module's tube, each of shape (rings * around, 3) [m].
        discs: vertices of all discs, base first.
        cables: vertices of every module's cables, as `threads` lays them out.
    """

    modules: tuple[Vertices, ...]
    discs: Vertices
    cables: tuple[Vertices, ...]


class Body:
    """Skins the states of one arm; the faces never change, only where their corners are.

    Attributes:
        tube_faces: of a module's tube.
        outline_faces: of the whole body in one, with a quarter of the corners.
        disc_faces: of all discs.
        cable_faces: of a module's cables.
    """

    def __init__(self, arm: ArmSpec):
        """The body of an arm."""
        geometry = ArmGeometry.of(arm)
        self._lengths, self._modules = geometry.lengths, arm.module_count
        self._radii = BODY * geometry.cable_radii
        self._angles = np.deg2rad([module.cable_angles_deg for module in arm.modules])
        self.tube_faces = _tube_faces(RINGS + 1, AROUND)
        self.outline_faces = _tube_faces(self._modules * (RINGS // COARSER + 1), AROUND // COARSER)
        self.cable_faces = thread_faces(arm.cable_count, RINGS + 1)
        self.disc_faces = np.concatenate(
            [_disc_faces() + 2 * (AROUND + 1) * number for number in range(self._modules + 1)]
        )

    def shape(self, states: States) -> Shape:
        """The body where the modules end in these states, shape (modules, 6)."""
        line = centre_line(states, self._lengths, RINGS)
        frames = _frames(line, states)
        tubes, cables = [], []
        for module in range(self._modules):
            part = slice(module * RINGS, (module + 1) * RINGS + 1)
            tubes.append(_rings(line[part], frames[part], self._radii[module], _TURNS).reshape(-1, 3))
            eyes = _rings(line[part], frames[part], CABLE * self._radii[module], self._angles[module])
            cables.append(threads(np.swapaxes(eyes, 0, 1), CABLE_THICK * self._radii[module]))
        return Shape(tuple(tubes), self._discs(line, frames), tuple(cables))

    def outline(self, shape: Shape) -> Vertices:
        """The whole body in one, for ghosts and shadows: base to tip, with a quarter of the corners."""
        rings = np.reshape(shape.modules, (self._modules, RINGS + 1, AROUND, 3))
        return rings[:, ::COARSER, ::COARSER].reshape(-1, 3)

    def _discs(self, line, frames) -> Vertices:
        """A thin closed cylinder at the base and at every module's end."""
        parts = []
        for number in range(self._modules + 1):
            place = number * RINGS
            radius = DISC * self._radii[max(number - 1, 0)]
            for side in (-1, 1):
                centre = line[place] + side * DISC_HALF * radius * frames[place, 2]
                ring = _rings(centre[None], frames[place][None], radius, _TURNS)[0]
                parts.append(np.concatenate([ring, centre[None]]))
        return np.concatenate(parts)


def threads(lines: Float[np.ndarray, "lines points 3"], radius: float) -> Vertices:
    """Thin tubes along lines, as triangles: browsers without a graphics card draw them far faster than wide lines."""
    tangents = np.gradient(lines, axis=1)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=-1, keepdims=True), 1e-12)
    aside = np.cross(tangents, np.where(np.abs(tangents[..., 2:]) < 0.7, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    aside /= np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-12)
    turns = 2 * np.pi * np.arange(THREAD_SIDES) / THREAD_SIDES
    outward = np.einsum("s,lpk->lpsk", np.cos(turns), aside)
    outward += np.einsum("s,lpk->lpsk", np.sin(turns), np.cross(tangents, aside))
    return (lines[:, :, None] + radius * outward).reshape(-1, 3)


def thread_faces(lines: int, points: int) -> Faces:
    """Faces of `threads`."""
    one = _tube_faces(points, THREAD_SIDES)
    return np.concatenate([one + number * points * THREAD_SIDES for number in range(lines)])


_TURNS = 2 * np.pi * np.arange(AROUND) / AROUND


def _frames(line: Float[np.ndarray, "points 3"], states: States) -> Float[np.ndarray, "points 3 3"]:
    """Rows x, y and tangent at every point; x is carried along without twist."""
    tangents = np.gradient(line, axis=0)
    tangents[0], tangents[-1] = (0.0, 0.0, 1.0), states[-1, 3:]
    tangents /= np.linalg.norm(tangents, axis=-1, keepdims=True)
    across = np.empty_like(tangents)
    x = np.array([1.0, 0.0, 0.0])
    for place, tangent in enumerate(tangents):
        x = x - (x @ tangent) * tangent
        x = x / np.linalg.norm(x)
        across[place] = x
    return np.stack([across, np.cross(tangents, across), tangents], axis=1)


def _rings(line, frames, radius: float, angles) -> Float[np.ndarray, "points around 3"]:
    """Points around the line."""
    outward = np.cos(angles)[:, None, None] * frames[:, 0] + np.sin(angles)[:, None, None] * frames[:, 1]
    return line[:, None] + radius * np.swapaxes(outward, 0, 1)


def _tube_faces(rings: int, around: int) -> Faces:
    ring, turn = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = ring * around + turn, ring * around + (turn + 1) % around
    c, d = a + around, b + around
    return np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, c], -1)]).reshape(-1, 3)


def _disc_faces() -> Faces:
    """Two rings, each followed by its centre: lower plate, wall, upper plate."""
    k, following = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    low, high = AROUND, 2 * AROUND + 1
    up = AROUND + 1
    wall = [np.stack([k, following, following + up], -1), np.stack([k, following + up, k + up], -1)]
    plates = [
        np.stack([following, k, np.full(AROUND, low)], -1),
        np.stack([k + up, following + up, np.full(AROUND, high)], -1),
    ]
    return np.concatenate([*wall, *plates])
