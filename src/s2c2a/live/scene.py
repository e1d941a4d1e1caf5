"""The scene: floor, arm, ghost, target, obstacles, trails, workspace. Drawn from State values alone."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from viser import IcosphereHandle, MeshHandle, SceneApi, SceneNodeDragEvent

from s2c2a.arm import ArmSpec
from s2c2a.live.ground import NO_SHADOW, lay_ground
from s2c2a.live.request import MOST_OBSTACLES, Obstacle, Point, Request, RequestLimits
from s2c2a.spaces import POSITION, States
from s2c2a.viz.colours import INK, OBSTACLE, REAL, TARGET, module_colours, rgb
from s2c2a.viz.mesh import THREAD_SIDES, ArmMesh, Vertices, threads, tube_faces

SHADOW, GHOST = "#d9dee6", "#5b6675"
SAME_PLACE = 0.015  # in parts of the arm's length: a ghost nearer to the arm than that is not shown
FAR_TARGET = "#f0a000"
SAFE, NEAR, INSIDE = OBSTACLE, "#f0a000", "#d62728"
NEAR_BY = 0.05  # m; an obstacle's sphere turns amber when the tip is closer than that
PALE = 0.6  # how much of the workspace's colours is white
BALL = 0.042  # radius of the target in parts of the arm's length
ARROW = 0.22  # length of the target's axis, the same
TRAIL_THICK, TRAIL_POINTS = 0.004, 90

Dragged = Callable[[int, Point], None]
"""Told who dragged (a client's number) and where to."""
DraggedOne = Callable[[int, int, Point], None]
"""Told who dragged, which one, and where to."""


class ArmScene:
    """One arm and what is round it, in a viser scene that all browsers share."""

    def __init__(self, scene: SceneApi, arm: ArmSpec):
        """Lay everything out, the arm straight."""
        self._scene, self._mesh, self._size = scene, ArmMesh(arm), arm.length
        around = lay_ground(scene, arm)
        self._up, self._level = around.mounting.turn[2], around.level if around.mounting.upright else None
        vertices = self._mesh.vertices(_straight(arm))
        self._pieces = [self._add_piece(number, corners) for number, corners in enumerate(vertices)]
        first, faces = self._mesh.outline(vertices), self._mesh.outline_faces
        outline: dict[str, Any] = {"visible": False, **NO_SHADOW}
        self._shadow = scene.add_mesh_simple("/shadow", first, faces, color=rgb(SHADOW), side="double", **outline)
        self._ghost = scene.add_mesh_simple("/ghost", first, faces, color=rgb(GHOST), opacity=0.22, **outline)
        self._trails = {name: self._add_thread(name, colour) for name, colour in (("real", REAL), ("wanted", TARGET))}
        self._target = _ball(scene, "/target", BALL * self._size, TARGET)
        self._pointer = _ball(scene, "/pointer", 0.6 * BALL * self._size, TARGET)
        self._shaft = self._add_thread("axis", TARGET)
        self._push = self._add_thread("push", FAR_TARGET)
        self._payload = _ball(scene, "/payload", 1.0, INK)
        self._far = scene.add_label("/far", "", visible=False, anchor="bottom-center", font_screen_scale=1.0)
        self._spheres, self._asked = (
            [_Sphere(scene, f"/{name}/{number}", self._level) for number in range(MOST_OBSTACLES)]
            for name in ("obstacles", "task_obstacles")
        )

    def draw_arm(self, states: States) -> None:
        """Put the arm where it is."""
        vertices = self._mesh.vertices(states)
        for handle, corners in zip(self._pieces[:-1], vertices, strict=False):  # but the base, which never moves
            handle.vertices = corners.astype(np.float32)
        if self._level is not None:  # far cheaper than a light's shadow
            flat = self._mesh.outline(vertices) * (1.0, 1.0, 0.0) + (0.0, 0.0, self._level + 0.002 * self._size)
            self._shadow.vertices = flat.astype(np.float32)
            _show(self._shadow, True)

    def draw_ghost(self, states: States | None, arm: States) -> None:
        """Show where the plan leads to, unless that is where the arm is already."""
        apart = 0.0 if states is None else np.linalg.norm(states[:, POSITION] - arm[:, POSITION], axis=-1).max()
        shown = states is not None and bool(apart >= SAME_PLACE * self._size)
        _show(self._ghost, shown)
        if states is not None and shown:
            self._ghost.vertices = self._mesh.outline(self._mesh.vertices(states)).astype(np.float32)

    def draw_target(self, position: Point | None, axis: Point | None, gap: float) -> None:
        """Show what is wanted of the tip; amber, with the distance left, where it is out of reach by `gap` [m]."""
        far = position is not None and gap > 0.005
        colour = rgb(FAR_TARGET if far else TARGET)
        _show(self._target, position is not None)
        _show(self._pointer, position is not None and axis is not None)
        _show(self._shaft, position is not None and axis is not None)
        _show(self._far, far)
        if position is None:
            return
        self._target.position = position
        if self._target.color != colour:
            self._target.color = colour
        if far:
            self._far.text = f"{100 * gap:.1f} cm out of reach"
            self._far.position = position + 0.05 * self._size * self._up
        if axis is not None:
            end = np.add(position, ARROW * self._size * np.array(axis))
            self._pointer.position = end
            self._lay(self._shaft, np.array([position, end]))

    def draw_load(self, tip: Float[np.ndarray, "3"], request: Request, limits: RequestLimits) -> None:
        """Show the payload under the tip, and the push as a line that ends at the tip; both as large as they are."""
        _show(self._payload, request.payload > 0)
        if request.payload > 0:
            radius = BALL * self._size * (request.payload / limits.payload) ** (1 / 3)
            self._payload.scale, self._payload.position = radius, tip - 1.4 * radius * self._up
        push = np.array(request.push)
        _show(self._push, bool(push.any()))
        if push.any():
            self._lay(self._push, np.array([tip - 0.4 * self._size * push / limits.push, tip]))

    def draw_obstacles(self, own: Sequence[Obstacle], asked: Sequence[Obstacle], tip: Float[np.ndarray, "3"]) -> None:
        """Show the driver's obstacles and the task's, coloured by how near the tip is."""
        for spheres, obstacles in ((self._spheres, own), (self._asked, asked)):
            for number, sphere in enumerate(spheres):
                sphere.draw(obstacles[number] if number < len(obstacles) else None, tip)

    def draw_trail(self, name: str, points: Float[np.ndarray, "points 3"]) -> None:
        """Show the way of the `real` or the `wanted` tip since it was last NaN."""
        gaps = np.flatnonzero(~np.isfinite(points).all(axis=-1))
        stretch = points[gaps[-1] + 1 if len(gaps) else 0 :]
        _show(self._trails[name], len(stretch) > 1)
        if len(stretch) > 1:
            self._lay(self._trails[name], stretch)

    def draw_cloud(self, points: Float[np.ndarray, "modules points 3"]) -> None:
        """Show where the modules' ends can be, in the modules' colours."""
        for number, (cloud, colour) in enumerate(zip(points, module_colours(len(points)), strict=True)):
            pale = np.array([int(value + PALE * (255 - value)) for value in rgb(colour)])
            self._scene.add_point_cloud(
                f"/workspace/{number}", cloud, pale, point_size=0.004 * self._size, point_shape="circle"
            )

    def show_cloud(self, shown: bool) -> None:
        """Show or hide the workspace."""
        self._scene.add_frame("/workspace", show_axes=False, visible=shown)

    def on_drag(self, target: Dragged, pointer: Dragged, obstacle: DraggedOne) -> None:
        """Tell who drags the target, the end of its axis, or one of the driver's obstacles."""
        _follow_drags(self._target, target)
        _follow_drags(self._pointer, pointer)
        for number, sphere in enumerate(self._spheres):
            sphere.on_drag(lambda who, where, number=number: obstacle(who, number, where))  # type: ignore[misc]

    def axis_towards(self, target: Point, pointer: Point) -> Point:
        """The direction from a target to the end of its axis."""
        x, y, z = np.subtract(pointer, target)
        return float(x), float(y), float(z)

    def _add_piece(self, number: int, corners: Vertices) -> MeshHandle:
        piece = self._mesh.pieces[number]
        look: dict[str, Any] = {"flat_shading": piece.name in ("discs", "base"), "cast_shadow": piece.name != "cables"}
        return self._scene.add_mesh_simple(f"/arm/{number}", corners, piece.faces, color=rgb(piece.colour), **look)

    def _add_thread(self, name: str, colour: str) -> MeshHandle:
        return self._scene.add_mesh_simple(
            f"/trails/{name}",
            np.zeros((TRAIL_POINTS * THREAD_SIDES, 3)),
            tube_faces(1, TRAIL_POINTS, THREAD_SIDES),
            color=rgb(colour),
            visible=False,
            **NO_SHADOW,
        )

    def _lay(self, thread: MeshHandle, points: Float[np.ndarray, "points 3"]) -> None:
        """Lay a thread along points, whatever their number."""
        places = np.linspace(0, len(points) - 1, TRAIL_POINTS)
        line = np.stack([np.interp(places, np.arange(len(points)), points[:, axis]) for axis in range(3)], axis=-1)
        thread.vertices = threads(line[None], TRAIL_THICK * self._size).astype(np.float32)


class _Sphere:
    """An obstacle: a small core in its threshold sphere."""

    def __init__(self, scene: SceneApi, name: str, level: float | None):
        self._level = level
        self._core = _ball(scene, f"{name}/core", 1.0, INK)
        self._threshold = _ball(scene, f"{name}/threshold", 1.0, SAFE, opacity=0.35)
        self._shadow = _ball(scene, f"{name}/shadow", 1.0, SHADOW)  # says how far away it is
        self._drawn: tuple | None = None

    def draw(self, obstacle: Obstacle | None, tip: Float[np.ndarray, "3"]) -> None:
        for part in (self._core, self._threshold):
            _show(part, obstacle is not None)
        _show(self._shadow, obstacle is not None and self._level is not None)
        if obstacle is None:
            return
        room = float(np.linalg.norm(np.subtract(tip, obstacle.centre))) - obstacle.threshold
        colour = INSIDE if room < 0 else NEAR if room < NEAR_BY else SAFE
        if self._drawn == (obstacle, colour):
            return
        self._drawn = (obstacle, colour)
        self._core.position = self._threshold.position = obstacle.centre
        self._core.scale, self._threshold.scale = 0.3 * obstacle.threshold, obstacle.threshold
        self._threshold.color = rgb(colour)
        self._shadow.position = (*obstacle.centre[:2], self._level or 0.0)
        self._shadow.scale = (obstacle.threshold, obstacle.threshold, 0.001)

    def on_drag(self, told: Dragged) -> None:
        _follow_drags(self._threshold, told)


def _follow_drags(handle: IcosphereHandle, told: Dragged) -> None:
    """Tell where the centre of a ball is dragged to: it keeps its offset from the point where it was grabbed."""
    offsets: dict[int, np.ndarray] = {}

    @handle.on_drag
    async def _(event: SceneNodeDragEvent) -> None:  # in the order of the messages
        if event.phase == "start":
            offsets[event.client_id] = np.subtract(handle.position, event.start_position)
        if event.client_id in offsets:
            x, y, z = np.add(event.end_position, offsets[event.client_id])
            told(event.client_id, (float(x), float(y), float(z)))
        if event.phase == "end":
            offsets.pop(event.client_id, None)


def _ball(scene: SceneApi, name: str, radius: float, colour: str, opacity: float | None = None) -> IcosphereHandle:
    return scene.add_icosphere(name, radius, color=rgb(colour), opacity=opacity, visible=False, **NO_SHADOW)


def _straight(arm: ArmSpec) -> States:
    """States of the straight arm, shape (modules, 6)."""
    states = np.zeros((arm.module_count, 6))
    states[:, 2], states[:, 5] = np.cumsum([module.length for module in arm.modules]), 1.0
    return states


def _show(node, shown: bool) -> None:
    if node.visible != shown:
        node.visible = shown
