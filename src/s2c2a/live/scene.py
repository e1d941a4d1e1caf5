"""The scene: floor, arm, ghost, target, obstacles, trails, workspace. Drawn from State values alone.

viser sends what is assigned only where it has changed, so everything is said anew in
every frame.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np
from jaxtyping import Float
from viser import IcosphereHandle, MeshHandle, SceneApi, SceneNodeDragEvent

from s2c2a.arm import ArmSpec
from s2c2a.live.request import (
    MAX_OBSTACLES,
    Obstacle,
    Point,
    Request,
    RequestLimits,
    point,
)
from s2c2a.live.snapshot import straight
from s2c2a.spaces import POSITION, States
from s2c2a.viz.colors import (
    GRID,
    GRID_STRONG,
    INK,
    OBSTACLE,
    REAL,
    TARGET,
    module_colors,
    rgb,
)
from s2c2a.viz.mesh import THREAD_SIDES, ArmMesh, threads, tube_faces
from s2c2a.viz.mounting import Surroundings

SHADOW = "#d9dee6"
GHOST = "#5b6675"
# in parts of the arm's length: a ghost nearer to the arm than that is not shown
SAME_PLACE = 0.015
FAR_TARGET = "#f0a000"
SAFE = OBSTACLE
NEAR = "#f0a000"
INSIDE = "#d62728"
NEAR_BY = 0.05  # m; an obstacle's sphere turns amber when the tip is closer than that
PALE = 0.6  # how much of the workspace's colors is white
BALL = 0.042  # radius of the target in parts of the arm's length
ARROW = 0.22  # length of the target's axis, the same
LINE = 0.0012  # half the width of a grid's line, the same
TRAIL_THICK = 0.004
TRAIL_POINTS = 90
SUN = (1.0, -1.4, 2.0)

Desired = Sequence[float] | np.ndarray | None
"""A place or direction; None or NaN where nothing is desired."""
Spheres = Float[np.ndarray, "obstacles 4"]
Dragged = Callable[[int, Point], None]
"""Told who dragged (a client's number) and where to."""


class ArmScene:
    """One arm and what is round it, in a viser scene that all browsers share."""

    def __init__(self, scene: SceneApi, arm: ArmSpec):
        """Lay everything out, the arm straight."""
        self._scene = scene
        self._mesh = ArmMesh(arm)
        self._size = arm.length
        around = _lay_ground(scene, arm)
        self._up = around.mounting.turn[2]
        self._level = around.level if around.arrow is None else None
        vertices = self._mesh.vertices(straight(arm))
        self._pieces: list[MeshHandle] = []
        for number, (piece, corners) in enumerate(
            zip(self._mesh.pieces, vertices, strict=True)
        ):
            flat = piece.name in ("discs", "base")
            self._pieces.append(
                _mesh(
                    scene,
                    f"/arm/{number}",
                    corners,
                    piece.faces,
                    piece.color,
                    flat_shading=flat,
                )
            )
        outline = self._mesh.outline(vertices)
        faces = self._mesh.outline_faces
        self._shadow = _mesh(
            scene, "/shadow", outline, faces, SHADOW, side="double", visible=False
        )
        self._ghost = _mesh(
            scene, "/ghost", outline, faces, GHOST, opacity=0.22, visible=False
        )
        colors = {"real": REAL, "desired": TARGET, "axis": TARGET, "push": FAR_TARGET}
        corners = np.zeros((TRAIL_POINTS * THREAD_SIDES, 3))
        faces = tube_faces(1, TRAIL_POINTS, THREAD_SIDES)
        line = partial(_mesh, scene, vertices=corners, faces=faces, visible=False)
        self._threads = {
            name: line(name=f"/trails/{name}", color=color)
            for name, color in colors.items()
        }
        self._target = _ball(scene, "/target", BALL * self._size, TARGET)
        self._pointer = _ball(scene, "/pointer", 0.6 * BALL * self._size, TARGET)
        self._payload = _ball(scene, "/payload", 1.0, INK)
        self._far = scene.add_label("/far", "", visible=False, anchor="bottom-center")
        numbers = range(MAX_OBSTACLES)
        names = ("/obstacles", "/task_obstacles")
        self._spheres, self._asked = (
            [_Sphere(scene, f"{name}/{k}", self._level) for k in numbers]
            for name in names
        )

    def draw_arm(self, states: States) -> None:
        """Put the arm where it is."""
        vertices = self._mesh.vertices(states)
        # but the base, which never moves
        for handle, corners in zip(self._pieces[:-1], vertices, strict=False):
            handle.vertices = corners
        if self._level is not None:  # far cheaper than a light's shadow
            flat = self._mesh.outline(vertices)
            flat[:, 2] = self._level + 0.002 * self._size
            self._shadow.vertices, self._shadow.visible = flat, True

    def draw_ghost(self, states: States | None, arm: States) -> None:
        """Show where the plan leads to, unless that is where the arm is already."""
        apart = (
            0.0
            if states is None
            else np.linalg.norm(states[:, POSITION] - arm[:, POSITION], axis=-1).max()
        )
        self._ghost.visible = bool(apart >= SAME_PLACE * self._size)
        if states is not None and self._ghost.visible:
            self._ghost.vertices = self._mesh.outline(self._mesh.vertices(states))

    def draw_target(self, position: Desired, axis: Desired, gap: float = 0.0) -> None:
        """Show what is desired of the tip; amber, with the distance left, where it is out of reach by `gap` [m]."""
        place = _known(position)
        direction = _known(axis)
        self._target.visible = place is not None
        self._far.visible = far = place is not None and gap > 0.005
        self._pointer.visible = place is not None and direction is not None
        if place is None:
            return self._lay("axis")
        self._target.position, self._target.color = (
            place,
            rgb(FAR_TARGET if far else TARGET),
        )
        if far:
            self._far.text = f"{100 * gap:.1f} cm out of reach"
            self._far.position = place + 0.05 * self._size * self._up
        self._pointer.position = end = place + ARROW * self._size * (
            0.0 if direction is None else direction
        )
        self._lay("axis", *(() if direction is None else (place, end)))

    def draw_load(
        self, tip: Float[np.ndarray, "3"], request: Request, limits: RequestLimits
    ) -> None:
        """Show the payload under the tip, and the push as a line that ends at the tip; both as large as they are."""
        self._payload.visible = request.payload > 0
        if request.payload > 0:
            radius = BALL * self._size * (request.payload / limits.payload) ** (1 / 3)
            self._payload.scale, self._payload.position = (
                radius,
                tip - 1.4 * radius * self._up,
            )
        push = np.array(request.push)
        self._lay(
            "push",
            *((tip - 0.4 * self._size * push / limits.push, tip) if push.any() else ()),
        )

    def draw_obstacles(
        self, own: Sequence[Obstacle], asked: Spheres, tip: Float[np.ndarray, "3"]
    ) -> None:
        """Show the driver's obstacles and the task's (centers, thresholds [m]), colored by how near the tip is."""
        others = [
            Obstacle(point(row[:3]), float(row[3])) for row in asked[:MAX_OBSTACLES]
        ]
        for spheres, obstacles in ((self._spheres, own), (self._asked, others)):
            for sphere, obstacle in zip_longest(spheres, obstacles):
                sphere.draw(obstacle, tip)

    def draw_trail(self, name: str, points: Float[np.ndarray, "points 3"]) -> None:
        """Show the way of the `real` or the `desired` tip since it was last NaN."""
        gaps = np.flatnonzero(~np.isfinite(points).all(axis=-1))
        self._lay(name, *points[gaps[-1] + 1 if len(gaps) else 0 :])

    def draw_cloud(
        self,
        points: Sequence[Float[np.ndarray, "points 3"]]
        | Float[np.ndarray, "modules points 3"],
    ) -> None:
        """Show where the modules' ends can be, in the modules' colors; nothing of a module without points."""
        size = 0.004 * self._size
        for number, (cloud, color) in enumerate(
            zip(points, module_colors(len(points)), strict=True)
        ):
            if not len(cloud):
                continue
            pale = np.array([int(value + PALE * (255 - value)) for value in rgb(color)])
            self._scene.add_point_cloud(
                f"/workspace/{number}",
                cloud,
                pale,
                point_size=size,
                point_shape="circle",
            )

    def show_cloud(self, shown: bool) -> None:
        """Show or hide the workspace."""
        self._scene.add_frame("/workspace", show_axes=False, visible=shown)

    def on_drag(
        self,
        target: Dragged,
        pointer: Dragged,
        obstacle: Callable[[int, int, Point], None],
    ) -> None:
        """Tell who drags the target, the end of its axis, or one of the driver's obstacles, whose number is first."""
        _follow_drags(self._target, target)
        _follow_drags(self._pointer, pointer)
        for number, sphere in enumerate(self._spheres):
            _follow_drags(sphere.threshold, partial(obstacle, number))

    def _lay(self, name: str, *points: Float[np.ndarray, "3"]) -> None:
        """Lay a thread along points, whatever their number; hide it where there are not two."""
        self._threads[name].visible = len(points) > 1
        if len(points) < 2:
            return
        places = np.linspace(0, len(points) - 1, TRAIL_POINTS)
        own = np.arange(len(points))
        line = np.stack(
            [np.interp(places, own, along) for along in np.transpose(points)], axis=-1
        )
        self._threads[name].vertices = threads(line[None], TRAIL_THICK * self._size)


def _known(desired: Desired) -> np.ndarray | None:
    return (
        None if desired is None or not np.isfinite(desired).all() else np.array(desired)
    )


class _Sphere:
    """An obstacle: a small core in its threshold sphere."""

    def __init__(self, scene: SceneApi, name: str, level: float | None):
        self._level = level
        self._core = _ball(scene, f"{name}/core", 1.0, INK)
        self.threshold = _ball(scene, f"{name}/threshold", 1.0, SAFE, opacity=0.35)
        # says how far away it is
        self._shadow = _ball(scene, f"{name}/shadow", 1.0, SHADOW)

    def draw(self, obstacle: Obstacle | None, tip: Float[np.ndarray, "3"]) -> None:
        self._core.visible = self.threshold.visible = obstacle is not None
        self._shadow.visible = obstacle is not None and self._level is not None
        if obstacle is None:
            return
        size = obstacle.threshold
        room = float(np.linalg.norm(np.subtract(tip, obstacle.center))) - size
        self.threshold.color = rgb(
            INSIDE if room < 0 else NEAR if room < NEAR_BY else SAFE
        )
        self._core.position = self.threshold.position = obstacle.center
        self._core.scale, self.threshold.scale = 0.3 * size, size
        self._shadow.position, self._shadow.scale = (
            (*obstacle.center[:2], self._level or 0.0),
            (size, size, 0.001),
        )


def _follow_drags(handle: IcosphereHandle, told: Dragged) -> None:
    """Tell where the center of a ball is dragged to: it keeps its offset from the point where it was grabbed."""
    offsets: dict[int, np.ndarray] = {}

    @handle.on_drag
    async def _(event: SceneNodeDragEvent) -> None:  # in the order of the messages
        if event.phase == "start":
            offsets[event.client_id] = np.subtract(
                handle.position, event.start_position
            )
        if event.client_id in offsets:
            told(
                event.client_id,
                point(np.add(event.end_position, offsets[event.client_id])),
            )
        if event.phase == "end":
            offsets.pop(event.client_id, None)


def _ball(
    scene: SceneApi, name: str, radius: float, color: str, **looks: Any
) -> IcosphereHandle:
    return scene.add_icosphere(
        name, radius, color=rgb(color), **{"visible": False, **looks}
    )


def _mesh(
    scene: SceneApi, name: str, vertices, faces, color: str, **looks: Any
) -> MeshHandle:
    return scene.add_mesh_simple(name, vertices, faces, color=rgb(color), **looks)


def _lay_ground(scene: SceneApi, arm: ArmSpec) -> Surroundings:
    """Turn the scene upright, light it, and put in what never moves; everything stays in the base frame.

    That is the plane that the arm is mounted on, the base frame, and where things fall
    if the arm does not stand.
    """
    around = Surroundings.of(arm)
    size = arm.length
    scene.set_up_direction(around.mounting.turn[2])
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere(
        "/lights/sky", ground_color=(190, 198, 210), intensity=1.6
    )
    above = tuple(SUN @ around.mounting.turn)
    scene.add_light_directional(
        "/lights/sun", color=(255, 250, 240), intensity=2.0, position=above
    )
    scene.world_axes.visible = False
    _lay_floor(scene, around.grid, LINE * size)
    scene.add_frame("/base_frame", axes_length=0.2 * size, axes_radius=0.005 * size)
    for name, place in around.names.items():
        scene.add_label(
            f"/base_frame/{name}", name, position=place, font_screen_scale=0.8
        )
    if around.arrow is not None:
        line = np.linspace(around.arrow[0], around.arrow[1], 12)
        _mesh(
            scene,
            "/gravity/line",
            threads(line[None], 0.006 * size),
            tube_faces(1, 12, 3),
            INK,
        )
        _ball(
            scene,
            "/gravity/end",
            0.018 * size,
            INK,
            position=around.arrow[1],
            visible=True,
        )
        scene.add_label(
            "/gravity/word", "gravity", position=around.arrow[0], font_screen_scale=0.8
        )
    return around


def _lay_floor(
    scene: SceneApi, grid: Float[np.ndarray, "lines 2 3"], half: float
) -> None:
    """Lines of two triangles: a shader's grid costs a browser without a graphics card a sixth of its time."""
    in_middle = np.abs(grid.sum(axis=1)[:, :2]).max(axis=-1) < half
    for name, lines, color in (
        ("fine", grid[~in_middle], GRID),
        ("strong", grid[in_middle], GRID_STRONG),
    ):
        aside = (
            half
            * np.cross((0.0, 0.0, 1.0), np.sign(lines[:, 1] - lines[:, 0]))[:, None]
        )
        corners = np.stack([lines - aside, lines + aside], axis=2).reshape(-1, 3)
        faces = (
            np.array([(0, 2, 1), (1, 2, 3)]) + 4 * np.arange(len(lines))[:, None, None]
        )
        _mesh(
            scene,
            f"/floor/{name}",
            corners,
            faces.reshape(-1, 3),
            color,
            flat_shading=True,
            side="double",
        )
