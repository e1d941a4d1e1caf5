"""3D scene of an arm: ground, arm, ghost, target, obstacles, trails, workspace.

Everything is drawn from State values. viser sends only assigned values that changed, so
each frame assigns all of them.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import zip_longest
from typing import Any

import numpy as np
from jaxtyping import Float
from viser import IcosphereHandle, MeshHandle, SceneApi, SceneNodeDragEvent

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import interpolated
from s2c2a.live.goals import curve_through
from s2c2a.live.request import (
    MAX_OBSTACLES,
    Obstacle,
    Point,
    Request,
    RequestLimits,
    point,
)
from s2c2a.live.snapshot import straight
from s2c2a.obstacles import CENTER, CORE, distances, is_sphere
from s2c2a.spaces import POSITION, States
from s2c2a.viz.colors import (
    DESIRED,
    DISC,
    GRID,
    GRID_STRONG,
    INK,
    MUTED,
    OBSTACLE,
    REAL,
    TOUCHED,
    WARNING,
    module_colors,
    pale,
    rgb,
)
from s2c2a.viz.mesh import THREAD_SIDES, ArmMesh, threads, tube_faces
from s2c2a.viz.mounting import SUN, Surroundings
from s2c2a.viz.solids import hull, surface
from s2c2a.viz.trace import STDS

NEAR_DISTANCE = 0.05  # m; clearance below which an obstacle turns amber
REACH_TOLERANCE = 0.005  # m; a target closer to the reach counts as reachable
TRAIL_POINTS = 90
UNCERTAINTY_OPACITY = 0.3
# lengths in arm lengths
SAME_POSE = 0.015  # a ghost closer to the arm is hidden
BALL_RADIUS = 0.042  # of the target
AXIS_LENGTH = 0.22  # of the target's axis
GRID_HALF_WIDTH = 0.0012
TRAIL_RADIUS = 0.004
WALL = 0.7  # half the edge of what is shown of a wall

Desired = Sequence[float] | np.ndarray | None
"""A position or direction; None or NaN where nothing is desired."""
Obstacles = Float[np.ndarray, "obstacles 12"]
Points = Float[np.ndarray, "points 3"]
Vector = Point | np.ndarray
DragHandler = Callable[[int, Point], None]
"""Called with the client number of the browser and the new position [m]."""


class ArmScene:
    """One arm and its surroundings in a viser scene that all browsers share."""

    def __init__(self, scene: SceneApi, arm: ArmSpec):
        """Add all objects, with the arm straight."""
        self._scene = scene
        self._mesh = ArmMesh(arm)
        self._size = arm.length
        self._radius = arm.modules[-1].radius
        surroundings = _add_surroundings(scene, arm)
        self._up = surroundings.mounting.turn[2]
        self._ground = surroundings.level if surroundings.arrow is None else None
        vertices = self._mesh.vertices(straight(arm))
        self._pieces: list[MeshHandle] = []
        for piece, corners in zip(self._mesh.pieces, vertices, strict=True):
            name = f"/arm/{len(self._pieces)}"
            flat = piece.name in ("discs", "base")
            handle = _add_mesh(
                scene, name, corners, piece.faces, piece.color, flat_shading=flat
            )
            self._pieces.append(handle)
        add_outline = partial(
            _add_mesh,
            scene,
            vertices=self._mesh.outline(vertices),
            faces=self._mesh.outline_faces,
            visible=False,
        )
        self._shadow = add_outline(name="/shadow", color=GRID, side="double")
        self._ghost = add_outline(name="/ghost", color=MUTED, opacity=0.22)
        add_line = partial(
            _add_mesh,
            scene,
            vertices=np.zeros((TRAIL_POINTS * THREAD_SIDES, 3)),
            faces=tube_faces(1, TRAIL_POINTS, THREAD_SIDES),
            visible=False,
        )
        colors = {
            "real": REAL,
            "desired": DESIRED,
            "horizon": MUTED,
            "axis": DESIRED,
            "shape": DESIRED,
            "force": WARNING,
        }
        self._lines = {
            name: add_line(name=f"/trails/{name}", color=color)
            for name, color in colors.items()
        }
        radius = BALL_RADIUS * self._size
        self._target = _add_ball(scene, "/target", radius, DESIRED)
        self._pointer = _add_ball(scene, "/pointer", 0.6 * radius, DESIRED)
        # translucent and wider than the arm, which covers them
        self._ends = [
            _add_ball(scene, f"/ends/{module}", 1.4 * radius, DESIRED, opacity=0.45)
            for module in range(arm.module_count - 1)
        ]
        self._payload = _add_ball(scene, "/payload", 1.0, INK)
        self._uncertainty = _add_ball(
            scene, "/uncertainty", 1.0, REAL, opacity=UNCERTAINTY_OPACITY
        )
        self._gap_label = scene.add_label(
            "/far", "", visible=False, anchor="bottom-center"
        )
        self._driver_solids = self._add_solids("/obstacles")
        self._task_solids = self._add_solids("/task_obstacles")

    def _add_solids(self, name: str) -> "list[_Solid]":
        parts = self._scene, self._ground, self._size, self._radius
        return [_Solid(f"{name}/{k}", *parts) for k in range(MAX_OBSTACLES)]

    def draw_arm(self, states: States) -> None:
        """Draw the arm and its shadow."""
        vertices = self._mesh.vertices(states)
        # the last piece is the base, which never moves
        for handle, corners in zip(self._pieces[:-1], vertices, strict=False):
            handle.vertices = corners
        if self._ground is not None:  # far cheaper than a light's shadow
            outline = self._mesh.outline(vertices)
            outline[:, 2] = self._ground + 0.002 * self._size
            self._shadow.vertices = outline
            self._shadow.visible = True

    def draw_ghost(self, states: States | None, arm: States) -> None:
        """Draw the planned states, unless the arm is there already."""
        distance = 0.0
        if states is not None:
            offsets = states[:, POSITION] - arm[:, POSITION]
            distance = np.linalg.norm(offsets, axis=-1).max()
        self._ghost.visible = bool(distance >= SAME_POSE * self._size)
        if states is not None and self._ghost.visible:
            self._ghost.vertices = self._mesh.outline(self._mesh.vertices(states))

    def draw_uncertainty(self, tip: Vector, predictive_std: float) -> None:
        """Draw a ball of twice the predictive standard deviation around the tip.

        It is hidden where the model has no uncertainty (zero or NaN).

        Args:
            tip: predicted position [m].
            predictive_std: of this position [m].
        """
        radius = STDS * predictive_std
        self._uncertainty.visible = bool(0.0 < radius < np.inf)
        if self._uncertainty.visible:
            self._uncertainty.position = tip
            self._uncertainty.scale = radius

    def draw_target(self, position: Desired, axis: Desired, gap: float = 0.0) -> None:
        """Draw the tip's desired position and axis.

        The target is amber, with its distance, where it is out of reach by `gap` [m].
        """
        center = _finite(position)
        direction = _finite(axis)
        far = center is not None and gap > REACH_TOLERANCE
        self._target.visible = center is not None
        self._gap_label.visible = far
        self._pointer.visible = center is not None and direction is not None
        if center is None:
            return self._draw_line("axis")
        self._target.position = center
        self._target.color = rgb(WARNING if far else DESIRED)
        if far:
            self._gap_label.text = f"{100 * gap:.1f} cm out of reach"
            self._gap_label.position = center + 0.05 * self._size * self._up
        if direction is None:
            return self._draw_line("axis")
        end = center + AXIS_LENGTH * self._size * direction
        self._pointer.position = end
        self._draw_line("axis", center, end)

    def draw_shape(self, ends: Sequence[Point] | None) -> None:
        """Draw the desired ends of all modules, and the curve through them."""
        for ball in self._ends:
            ball.visible = ends is not None
        if ends is None:
            return self._draw_line("shape")
        for ball, end in zip(self._ends, ends, strict=False):
            ball.position = end
        curve, parameters = curve_through(ends)
        self._draw_line("shape", *curve(np.linspace(0.0, parameters[-1], TRAIL_POINTS)))

    def draw_payload(
        self, tip: Vector, request: Request, limits: RequestLimits
    ) -> None:
        """Draw payload and external force in proportion to their limits.

        The payload hangs under the tip; the force is a line that ends at the tip.
        """
        self._payload.visible = request.payload > 0
        if request.payload > 0:
            share = request.payload / limits.payload
            radius = BALL_RADIUS * self._size * share ** (1 / 3)
            self._payload.scale = radius
            self._payload.position = np.subtract(tip, 1.4 * radius * self._up)
        force = np.array(request.force)
        if not force.any():
            return self._draw_line("force")
        start = np.subtract(tip, 0.4 * self._size * force / limits.force)
        self._draw_line("force", start, tip)

    def draw_obstacles(
        self,
        obstacles: Sequence[Obstacle],
        of_task: Obstacles,
        tip: Vector,
    ) -> None:
        """Draw obstacles, colored by the clearance of the tip.

        Args:
            obstacles: the driver's.
            of_task: rows (`s2c2a.obstacles`).
            tip: position of the tip [m].
        """
        task_obstacles = map(Obstacle.of, of_task[:MAX_OBSTACLES])
        for solid, obstacle in zip_longest(self._driver_solids, obstacles):
            solid.draw(obstacle, tip)
        for solid, obstacle in zip_longest(self._task_solids, task_obstacles):
            solid.draw(obstacle, tip)

    def draw_trail(self, name: str, points: Points) -> None:
        """Draw the path of the `real` or `desired` tip, or its `horizon`.

        It begins after the last NaN.
        """
        missing = np.flatnonzero(~np.isfinite(points).all(axis=-1))
        start = missing[-1] + 1 if len(missing) else 0
        self._draw_line(name, *points[start:])

    def draw_cloud(
        self, points: Sequence[Points] | Float[np.ndarray, "modules points 3"]
    ) -> None:
        """Draw the workspace: ends of each module [m], in the modules' colors."""
        colors = module_colors(len(points))
        for number, (cloud, color) in enumerate(zip(points, colors, strict=True)):
            if not len(cloud):
                continue
            self._scene.add_point_cloud(
                f"/workspace/{number}",
                cloud,
                np.array(rgb(pale(color, 0.6))),
                point_size=0.004 * self._size,
                point_shape="circle",
            )

    def show_cloud(self, visible: bool) -> None:
        """Show or hide the workspace."""
        self._scene.add_frame("/workspace", show_axes=False, visible=visible)

    def on_drag(
        self,
        target: DragHandler,
        pointer: DragHandler,
        obstacle: Callable[[int, int, Point], None],
        end: Callable[[int, int, Point], None],
    ) -> None:
        """Set the handlers of drags.

        Args:
            target: of the target.
            pointer: of the end of the target's axis.
            obstacle: of the driver's obstacles; gets the obstacle's number first.
            end: of the desired ends below the tip; gets the module's number first.
        """
        _add_drag_handler(self._target, target)
        _add_drag_handler(self._pointer, pointer)
        for number, solid in enumerate(self._driver_solids):
            solid.on_drag(partial(obstacle, number))
        for number, ball in enumerate(self._ends):
            _add_drag_handler(ball, partial(end, number))

    def _draw_line(self, name: str, *points: Vector) -> None:
        """Draw a line through points; hide it with fewer than two."""
        line = self._lines[name]
        line.visible = len(points) > 1
        if len(points) < 2:
            return
        samples = np.linspace(0, len(points) - 1, TRAIL_POINTS)
        numbers = np.arange(len(points))
        path = interpolated(samples, numbers, np.array(points))
        line.vertices = threads(path[None], TRAIL_RADIUS * self._size)


def _finite(desired: Desired) -> np.ndarray | None:
    if desired is None or not np.isfinite(desired).all():
        return None
    return np.array(desired)


class _Solid:
    """An obstacle, with a small core if it is a sphere, and its shadow."""

    def __init__(
        self,
        name: str,
        scene: SceneApi,
        ground: float | None,
        size: float,
        radius: float,
    ):
        self._scene = scene
        self._name = name
        self._radius = radius
        self._ground = ground
        self._size = size
        self._core = _add_ball(scene, f"{name}/core", 1.0, INK)
        self._ball = _add_ball(scene, f"{name}/threshold", 1.0, OBSTACLE, opacity=0.35)
        # the shadow shows how far away the obstacle is
        self._shadow = _add_ball(scene, f"{name}/shadow", 1.0, GRID)
        self._body: MeshHandle | None = None
        self._shape: tuple[float, ...] = ()
        self._middle = np.zeros(3)
        self._drag: DragHandler | None = None

    def on_drag(self, handler: DragHandler) -> None:
        """Set the handler of drags."""
        self._drag = handler
        _add_drag_handler(self._ball, handler)

    def draw(self, obstacle: Obstacle | None, tip: Vector) -> None:
        """Show the obstacle, or none."""
        is_ball = obstacle is not None and is_sphere(obstacle.row)
        self._core.visible = self._ball.visible = is_ball
        self._shadow.visible = is_ball and self._ground is not None
        if self._body is not None:
            self._body.visible = obstacle is not None and not is_ball
        if obstacle is None:
            return
        row = obstacle.row
        gap = distances(np.asarray(tip), row[CENTER], row[CORE])
        color = rgb(_clearance_color(float(gap) - obstacle.threshold - self._radius))
        if not is_ball:
            self._draw_body(obstacle).color = color
            return
        radius = obstacle.threshold
        self._ball.color = color
        self._core.position = self._ball.position = obstacle.center
        self._core.scale = 0.3 * radius
        self._ball.scale = radius
        self._shadow.position = (*obstacle.center[:2], self._ground or 0.0)
        self._shadow.scale = (radius, radius, 0.001)

    def _draw_body(self, obstacle: Obstacle) -> MeshHandle:
        """The mesh of a solid that is no sphere, at its place."""
        row = obstacle.row
        shape = (obstacle.threshold, *obstacle.core)
        if obstacle.is_wall:  # what is shown of it does not move with its center
            shape = tuple(row)
        if self._body is None or shape != self._shape:
            points = surface(row, WALL * self._size)
            # browsers sort what is translucent by these places
            self._middle = points.mean(axis=0) - row[CENTER]
            corners, triangles = hull(points - points.mean(axis=0))
            self._body = self._scene.add_mesh_simple(
                f"{self._name}/body",
                corners.astype(np.float32),
                triangles,
                opacity=0.15 if obstacle.is_wall else 0.35,
                flat_shading=True,
                side="double",
            )
            self._shape = shape
            if self._drag is not None and not obstacle.is_wall:
                _add_drag_handler(self._body, self._drag)
        self._body.visible = True
        self._body.position = point(row[CENTER] + self._middle)
        return self._body


def _clearance_color(clearance: float) -> str:
    if clearance < 0:
        return TOUCHED
    return WARNING if clearance < NEAR_DISTANCE else OBSTACLE


def _add_drag_handler(
    handle: IcosphereHandle | MeshHandle, handler: DragHandler
) -> None:
    """Report the dragged center of a solid, which keeps its offset from the mouse."""
    offsets: dict[int, np.ndarray] = {}

    @handle.on_drag
    async def _(event: SceneNodeDragEvent) -> None:  # in the order of the messages
        client = event.client_id
        if event.phase == "start":
            offsets[client] = np.subtract(handle.position, event.start_position)
        if client in offsets:
            handler(client, point(np.add(event.end_position, offsets[client])))
        if event.phase == "end":
            offsets.pop(client, None)


def _add_ball(
    scene: SceneApi,
    name: str,
    radius: float,
    color: str,
    visible: bool = False,
    **options: Any,
) -> IcosphereHandle:
    return scene.add_icosphere(
        name, radius, color=rgb(color), visible=visible, **options
    )


def _add_mesh(
    scene: SceneApi, name: str, vertices, faces, color: str, **options: Any
) -> MeshHandle:
    return scene.add_mesh_simple(name, vertices, faces, color=rgb(color), **options)


def _add_surroundings(scene: SceneApi, arm: ArmSpec) -> Surroundings:
    """Add the lights and what never moves, and turn the scene upright.

    Coordinates remain in the base frame. The plane on which the arm is mounted and the
    base frame are shown, and the direction of gravity if the arm does not stand.
    """
    surroundings = Surroundings.of(arm)
    size = arm.length
    turn = surroundings.mounting.turn
    scene.set_up_direction(turn[2])
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/lights/sky", ground_color=rgb(DISC), intensity=1.6)
    scene.add_light_directional(
        "/lights/sun", intensity=2.0, position=tuple(SUN @ turn)
    )
    scene.world_axes.visible = False
    through_origin = surroundings.through_origin
    for name, lines, color in (
        ("fine", surroundings.grid[~through_origin], GRID),
        ("strong", surroundings.grid[through_origin], GRID_STRONG),
    ):
        _add_grid_lines(scene, f"/floor/{name}", lines, color, GRID_HALF_WIDTH * size)
    scene.add_frame("/base_frame", axes_length=0.2 * size, axes_radius=0.005 * size)
    for name, position in surroundings.names.items():
        scene.add_label(
            f"/base_frame/{name}", name, position=position, font_screen_scale=0.8
        )
    if surroundings.arrow is not None:
        tube = threads(surroundings.arrow[None], 0.006 * size)
        _add_mesh(scene, "/gravity/line", tube, tube_faces(1, 2, THREAD_SIDES), INK)
        start, end = surroundings.arrow
        _add_ball(scene, "/gravity/end", 0.018 * size, INK, True, position=end)
        scene.add_label(
            "/gravity/word", "gravity", position=start, font_screen_scale=0.8
        )
    return surroundings


def _add_grid_lines(
    scene: SceneApi, name: str, lines: np.ndarray, color: str, half_width: float
) -> None:
    """Add grid lines of two triangles each, which tubes would make darker.

    A shader's grid costs a browser without a graphics card a sixth of its time.
    """
    directions = np.sign(lines[:, 1] - lines[:, 0])
    offsets = half_width * np.cross((0.0, 0.0, 1.0), directions)[:, None]
    sides = np.stack([lines - offsets, lines + offsets], axis=2)
    corners = sides.reshape(-1, 3)
    triangles = np.array([(0, 2, 1), (1, 2, 3)])
    faces = triangles + 4 * np.arange(len(lines))[:, None, None]
    _add_mesh(
        scene,
        name,
        corners,
        faces.reshape(-1, 3),
        color,
        flat_shading=True,
        side="double",
    )
