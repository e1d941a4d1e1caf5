"""Snapshots of the arm as standard messages of ROS 2."""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import cables_present
from s2c2a.integrations.ros.messages import (
    DIAGNOSTICS,
    JOINTS,
    MARKERS,
    POSE,
    header_of,
    new,
)
from s2c2a.kinematics import configurations_from_states
from s2c2a.live.goals import curve_through
from s2c2a.live.request import Request, point
from s2c2a.live.snapshot import Snapshot
from s2c2a.obstacles import CENTER, CORE, DISC, HALF_EDGES, THRESHOLD, TURN
from s2c2a.spaces import AXIS, POSITION
from s2c2a.viz.colors import DESIRED, OBSTACLE, REAL, rgb

LINE_STRIP = 4  # visualization_msgs/Marker.LINE_STRIP
CUBE = 1  # visualization_msgs/Marker.CUBE
SPHERE = 2  # visualization_msgs/Marker.SPHERE
DELETE_ALL = 3  # visualization_msgs/Marker.DELETEALL
CURVE_POINTS = 33  # chosen: a smooth line at the size of a screen
OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/DiagnosticStatus
NO_TURN = (0.0, 0.0, 0.0, 1.0)
OPACITIES = {REAL: 1.0, DESIRED: 0.9, OBSTACLE: 0.6}  # of arm, target and obstacles


class Outputs:
    """Builds the messages of one arm."""

    def __init__(self, arm: ArmSpec, frame: str):
        """Name the joints.

        Args:
            arm: whose snapshots come.
            frame: id of the base frame.
        """
        self.arm = arm
        self.frame = frame
        self._present = cables_present(arm)
        self._cables = [
            f"module_{module + 1}_cable_{cable + 1}"
            for module, cable in np.argwhere(self._present)
        ]
        self._bends = [
            f"module_{module + 1}_bend_{axis}"
            for module in range(arm.module_count)
            for axis in "xy"
        ]

    def cables(self, values: np.ndarray, moment: float) -> Any:
        """Cables as JointState: displacements as positions [m], else efforts [N or Pa]."""
        numbers = np.reshape(values, self._present.shape)[self._present]
        if self.arm.actuation == "displacement":
            return self._joints(self._cables, numbers, [], moment)
        return self._joints(self._cables, [], numbers, moment)

    def bends(self, snapshot: Snapshot, moment: float) -> Any:
        """The configuration as JointState: bends [rad], module frames."""
        configurations = configurations_from_states(snapshot.states)
        lateral = configurations[:, :2]
        sines = np.linalg.norm(lateral, axis=-1, keepdims=True)
        angles = np.arctan2(sines, configurations[:, 2:])
        bends = lateral * angles / np.maximum(sines, np.finfo(float).tiny)
        return self._joints(self._bends, bends.ravel(), [], moment)

    def tip(self, snapshot: Snapshot, moment: float) -> Any:
        """Pose of the tip [m], base frame; without turn about its end axis."""
        turn = turn_to(snapshot.states[-1, AXIS])
        header = header_of(self.frame, moment)
        return new(POSE, header=header, pose=_pose(snapshot.tip, turn))

    def markers(self, snapshot: Snapshot, request: Request, moment: float) -> Any:
        """The arm, its target and its obstacles, instead of all markers of before."""
        header = header_of(self.frame, moment)
        parts: list[dict[str, Any]] = [{"action": DELETE_ALL}]
        parts += self._solids(snapshot, request)
        parts += self._obstacles(snapshot, request)
        markers = [_marker(header, number, **part) for number, part in enumerate(parts)]
        return new(MARKERS, markers=markers)

    def status(
        self, snapshot: Snapshot | None, control: dict[str, Any], moment: float
    ) -> Any:
        """Stage, errors and fault as DiagnosticArray.

        Args:
            snapshot: the latest one.
            control: more values by name; "stopped" and "fault" decide the level.
            moment: since 1970 [s].
        """
        values = dict(control)
        if snapshot:
            values |= {
                "stage": snapshot.stage,
                "fault": snapshot.fault,
                "ignored": snapshot.ignored,
                "strategy": snapshot.strategy,
                "step": snapshot.step.number,
                "tip_error_m": snapshot.error,
                "clearance_m": snapshot.clearance,
                "task_step": snapshot.task_step,
                "task_steps": snapshot.task_steps,
                "controller_time_s": snapshot.step.tick_time,
                "late_s": snapshot.step.late,
            }
        fault = values.get("fault") or ""
        stopped = control.get("stopped_by") or ""
        level = ERROR if fault else WARN if stopped else OK
        stage = str(snapshot.stage) if snapshot else "opening"
        pairs = []
        for name, value in values.items():
            text = f"{value:.6g}" if isinstance(value, float) else str(value)
            pairs.append(new("diagnostic_msgs/msg/KeyValue", key=name, value=text))
        status = new(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=level,
            name="s2c2a: control",
            message=fault or (f"stopped by {stopped}" if stopped else stage),
            hardware_id=self.arm.name,
            values=pairs,
        )
        return new(DIAGNOSTICS, header=header_of("", moment), status=[status])

    def _joints(
        self, names: list[str], positions: Any, efforts: Any, moment: float
    ) -> Any:
        return new(
            JOINTS,
            header=header_of(self.frame, moment),
            name=names,
            position=np.asarray(positions, dtype=float),
            velocity=np.zeros(0),
            effort=np.asarray(efforts, dtype=float),
        )

    def _solids(self, snapshot: Snapshot, request: Request) -> Iterable[dict[str, Any]]:
        curve, knots = curve_through([point(row[POSITION]) for row in snapshot.states])
        # without a radius in the arm file, the body ends at the cables
        radii = [module.radius or module.cable_radius for module in self.arm.modules]
        yield {
            "kind": LINE_STRIP,
            "scale": (2.0 * max(radii), 0.0, 0.0),
            "color": REAL,
            "points": curve(np.linspace(0.0, knots[-1], CURVE_POINTS)),
        }
        sphere = {"kind": SPHERE, "scale": (2.5 * radii[-1],) * 3}
        yield {**sphere, "center": snapshot.tip, "color": REAL}
        goal = snapshot.step.goal
        target = request.target
        if request.task and goal is not None:
            target = point(goal.desired_positions()[-1])
        if target is not None and all(map(math.isfinite, target)):
            yield {**sphere, "center": target, "color": DESIRED}

    def _obstacles(
        self, snapshot: Snapshot, request: Request
    ) -> Iterable[dict[str, Any]]:
        goal = snapshot.step.goal
        rows = [obstacle.row for obstacle in request.obstacles]
        if goal is not None:  # with those of the task
            rows = list(goal.obstacles_in_use())
        for each in rows:
            row = np.asarray(each, dtype=float)
            core = row[CORE]
            halves = core[HALF_EDGES] + core[DISC] * np.array([1.0, 1.0, 0.0])
            turn = core[TURN]
            yield {  # a sphere, or the box around any other solid
                "kind": CUBE if halves.any() else SPHERE,
                "center": row[CENTER],
                "turn": turn if turn.any() else NO_TURN,
                "scale": 2.0 * (halves + row[THRESHOLD]),
                "color": OBSTACLE,
            }


def turn_to(axis: np.ndarray) -> np.ndarray:
    """Unit quaternion (x, y, z, w) that turns the z axis to a direction, the short way."""
    x, y, z = axis / np.linalg.norm(axis)
    turn = np.array([-y, x, 0.0, 1.0 + z])
    length = np.linalg.norm(turn)
    if length < np.finfo(np.float32).eps:  # straight back: any axis across serves
        return np.array([1.0, 0.0, 0.0, 0.0])
    return turn / length


def _marker(
    header: Any,
    number: int,
    kind: int = SPHERE,
    action: int = 0,
    center: Any = (0.0, 0.0, 0.0),
    turn: Any = NO_TURN,
    scale: Any = (1.0, 1.0, 1.0),
    color: str = REAL,
    points: Any = (),
) -> Any:
    channels = np.divide(rgb(color), 255.0)
    red, green, blue = channels.tolist()
    opacity = OPACITIES[color]
    nothing = np.zeros(0, np.uint8)
    image = new(
        "sensor_msgs/msg/CompressedImage", header=header, format="", data=nothing
    )
    mesh = new("visualization_msgs/msg/MeshFile", filename="", data=nothing)
    return new(
        "visualization_msgs/msg/Marker",
        header=header,
        ns="s2c2a",
        id=number,
        type=kind,
        action=action,
        pose=_pose(center, turn),
        scale=_vector("Vector3", scale),
        color=new("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=opacity),
        lifetime=new("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        frame_locked=False,
        points=[_vector("Point", each) for each in points],
        # for text, textures and meshes
        colors=[],
        texture_resource="",
        texture=image,
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=mesh,
        mesh_use_embedded_materials=False,
    )


def _vector(kind: str, values: Any) -> Any:
    x, y, z = point(values)
    return new(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)


def _pose(center: Any, turn: Any) -> Any:
    x, y, z, w = map(float, turn)
    orientation = new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    position = _vector("Point", center)
    return new("geometry_msgs/msg/Pose", position=position, orientation=orientation)
