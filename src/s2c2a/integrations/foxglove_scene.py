"""Scenes as messages of Foxglove, for MCAP files and live streams."""

from typing import Any

import foxglove
import numpy as np
from foxglove import channels, messages
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.integrations.scenes import StepScene, mesh_of
from s2c2a.viz.colors import DESIRED, OBSTACLE, module_colors, rgb
from s2c2a.viz.mesh import frames_of
from s2c2a.viz.mounting import Mounting

WORLD = "world"
BASE = "base"
SCENE = "/scene"
STEP = "/step"
TARGET_SIZE = 0.02  # diameter, as a share of the arm's length; looks
OPACITY = 0.6  # of obstacles; looks
NANOSECONDS = 1_000_000_000


def step_name(column: str) -> str:
    """Name of a column in messages of a step: paths of Foxglove end at a point."""
    return column.replace(".", "_")


class FoxgloveScene:
    """Channels of one arm in a context of the SDK."""

    def __init__(self, arm: ArmSpec, context: Any):
        """Create the channels.

        Args:
            arm: that is shown.
            context: `foxglove.Context`, with or without sinks.
        """
        self._arm = arm
        schema = {"title": "s2c2a.Step", "type": "object"}
        self._step = foxglove.Channel(STEP, schema=schema, context=context)
        self._transforms = channels.FrameTransformsChannel("/tf", context=context)
        self._scene = channels.SceneUpdateChannel(SCENE, context=context)
        self._commands = channels.JointStatesChannel("/commands", context=context)
        self._measured = channels.JointStatesChannel("/measured", context=context)

    def log(self, scene: StepScene, moment: int) -> None:
        """Log a scene.

        Args:
            scene: to log.
            moment: its time [ns].
        """
        stamp = messages.Timestamp(*divmod(moment, NANOSECONDS))
        numbers = {
            step_name(name): value if np.isfinite(value) else None
            for name, value in scene.numbers.items()
        }
        self._step.log(numbers, log_time=moment)
        # frames of the base in the world, and of the module ends in the base
        turn = Mounting.of(self._arm).turn
        transforms = [_transform(WORLD, BASE, np.zeros(3), turn, stamp)]
        if scene.states is not None:
            for number, frame in enumerate(frames_of(scene.states)[1:], 1):
                name = f"module_{number}"
                turn = frame[1:].T
                transforms.append(_transform(BASE, name, frame[0], turn, stamp))
        frames = messages.FrameTransforms(transforms=transforms)
        self._transforms.log(frames, log_time=moment)
        self._log_solids(scene, stamp, moment)
        for channel, prefix in (
            (self._commands, "actions."),
            (self._measured, "sensor.cables."),
        ):
            if states := _joints(self._arm, scene, prefix, stamp):
                channel.log(states, log_time=moment)

    def _log_solids(self, scene: StepScene, stamp: Any, moment: int) -> None:
        """Log the center line in the colors of the modules, targets and obstacles."""
        arm = self._arm
        parts: dict[str, Any] = {"arm": {}, "targets": {}, "obstacles": {}}
        if len(scene.line):
            points = (len(scene.line) - 1) // arm.module_count
            colors = []
            for color in module_colors(arm.module_count):
                colors += [_color(color)] * points
            line = messages.LinePrimitive(
                thickness=2 * float(per_module(arm, "cable_radius").mean()),
                points=_points(scene.line),
                colors=[colors[0], *colors],
            )
            parts["arm"] = {"lines": [line]}
        upright = messages.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
        spheres = []
        for target in scene.targets.values():
            pose = messages.Pose(position=_vector(target), orientation=upright)
            size = _vector(np.full(3, TARGET_SIZE * arm.length))
            color = _color(DESIRED)
            spheres.append(messages.SpherePrimitive(pose=pose, size=size, color=color))
        parts["targets"] = {"spheres": spheres}
        corners, triangles = mesh_of(scene.obstacles, arm.length)
        if len(corners):
            solid = messages.TriangleListPrimitive(
                points=_points(corners),
                indices=triangles.reshape(-1).tolist(),
                color=_color(OBSTACLE, OPACITY),
            )
            parts["obstacles"] = {"triangles": [solid]}
        # an entity replaces the one of the same name before it
        entities = [
            messages.SceneEntity(timestamp=stamp, frame_id=BASE, id=name, **part)
            for name, part in parts.items()
        ]
        update = messages.SceneUpdate(entities=entities)
        self._scene.log(update, log_time=moment)


def _transform(
    parent: str, child: str, position: np.ndarray, turn: np.ndarray, stamp: Any
) -> Any:
    x, y, z, w = Rotation.from_matrix(turn).as_quat().tolist()
    return messages.FrameTransform(
        timestamp=stamp,
        parent_frame_id=parent,
        child_frame_id=child,
        translation=_vector(position),
        rotation=messages.Quaternion(x=x, y=y, z=z, w=w),
    )


def _vector(values: np.ndarray) -> Any:
    x, y, z = values.tolist()
    return messages.Vector3(x=x, y=y, z=z)


def _points(values: np.ndarray) -> list:
    rows = values.tolist()
    return [messages.Point3(x=x, y=y, z=z) for x, y, z in rows]


def _color(color: str, opacity: float = 1.0) -> Any:
    r, g, b = (value / 255 for value in rgb(color))
    return messages.Color(r=r, g=g, b=b, a=opacity)


def _joints(arm: ArmSpec, scene: StepScene, prefix: str, stamp: Any) -> Any:
    """Cables as joints: displacements as positions [m], tensions as efforts [N]."""
    key = "position" if arm.unit == "m" else "effort"
    joints = [
        messages.JointState(name=name.removeprefix(prefix), **{key: value})
        for name, value in scene.numbers.items()
        if name.startswith(prefix) and np.isfinite(value)
    ]
    return messages.JointStates(timestamp=stamp, joints=joints) if joints else None
