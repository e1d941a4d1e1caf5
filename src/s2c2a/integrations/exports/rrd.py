"""Recordings of Rerun."""

from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.arm.geometry import per_module
from s2c2a.cli.export_table import LOG_TIME, Columns, table_of
from s2c2a.episodes import load_episodes
from s2c2a.files.text import atomic_write
from s2c2a.integrations.extras import needs_extra
from s2c2a.integrations.scenes import StepScene, mesh_of, scenes_of
from s2c2a.obstacles import ROW
from s2c2a.spaces import POSITION
from s2c2a.viz.colors import DESIRED, OBSTACLE, module_colors, rgb
from s2c2a.viz.mounting import Mounting

with needs_extra("rerun", "the form rrd"):
    import rerun
    from rerun import blueprint

TIME = "time"
"""Timeline [s]."""
WORLD = "world"
NUMBERS = "numbers"
"""Root of the numbers: `numbers/sensor/cables` holds those of the column."""
TARGET_SIZE = 0.01  # radius, as a share of the arm's length; looks
OPACITY = 150  # of obstacles, of 255; looks


def write_rrd(file: Path, out: Path) -> str:
    """Write a recording for Rerun.

    Raises:
        S2C2AError: the file cannot be written.
    """
    episodes, _ = load_episodes(file)
    arm = episodes[0].arm
    with atomic_write(out) as part:
        with rerun.RecordingStream("s2c2a", recording_id=file.stem) as stream:
            try:
                stream.save(part, default_blueprint=_layout())
            except RuntimeError as error:
                raise OSError(str(error)) from error
            stream.log("arm_file", rerun.TextDocument(arm_to_toml(arm)), static=True)
            up = rerun.ViewCoordinates.RIGHT_HAND_Z_UP
            stream.log(WORLD, up, static=True)
            turn = rerun.Transform3D(mat3x3=Mounting.of(arm).turn)
            stream.log(WORLD, turn, static=True)
            _log_numbers(stream, table_of(episodes))
            obstacles = np.zeros((0, ROW))
            for scene in scenes_of(episodes):
                _log_scene(stream, arm, scene)
                if not np.array_equal(scene.obstacles, obstacles):
                    obstacles = scene.obstacles
                    _log_obstacles(stream, arm, obstacles)
            stream.flush()
        stream.disconnect()
    return f"{len(episodes)} episodes"


def _log_numbers(stream: rerun.RecordingStream, table: Columns) -> None:
    """Log the numbers of all steps: an entity for every column of an episode."""
    columns: dict[str, list[str]] = {}
    for name in table:
        # `actions.1.2` is one of `actions`
        parts = takewhile(lambda part: not part.isdigit(), name.split("."))
        columns.setdefault("/".join([NUMBERS, *parts]), []).append(name)
    times = rerun.TimeColumn(TIME, duration=table[LOG_TIME])
    for path, names in columns.items():
        stream.log(path, rerun.SeriesLines(names=names), static=True)
        values = np.stack([table[name] for name in names], axis=1)
        scalars = rerun.Scalars.columns(scalars=values.reshape(-1))
        rows = scalars.partition([len(names)] * len(values))
        stream.send_columns(path, [times], rows)


def _log_scene(stream: rerun.RecordingStream, arm: ArmSpec, scene: StepScene) -> None:
    """Log the center line of every module in its color, the ends, and targets."""
    stream.set_time(TIME, duration=scene.time)
    if scene.states is not None:
        modules = arm.module_count
        points = (len(scene.line) - 1) // modules
        strips = [
            scene.line[points * module : points * (module + 1) + 1]
            for module in range(modules)
        ]
        colors = [rgb(color) for color in module_colors(modules)]
        radii = per_module(arm, "cable_radius")
        lines = rerun.LineStrips3D(strips, colors=colors, radii=radii)
        stream.log(f"{WORLD}/arm", lines)
        ends = rerun.Points3D(scene.states[:, POSITION], colors=colors)
        stream.log(f"{WORLD}/ends", ends)
    targets = np.array(list(scene.targets.values())).reshape(-1, 3)
    size = TARGET_SIZE * arm.length
    spheres = rerun.Points3D(targets, radii=size, colors=[rgb(DESIRED)])
    stream.log(f"{WORLD}/targets", spheres)


def _log_obstacles(
    stream: rerun.RecordingStream, arm: ArmSpec, obstacles: np.ndarray
) -> None:
    points, triangles = mesh_of(obstacles, arm.length)
    path = f"{WORLD}/obstacles"
    if not len(points):
        stream.log(path, rerun.Clear(recursive=False))
        return
    color = [*rgb(OBSTACLE), OPACITY]
    mesh = rerun.Mesh3D(
        vertex_positions=points, triangle_indices=triangles, albedo_factor=color
    )
    stream.log(path, mesh)


def _layout() -> Any:
    """Views of a recording: the scene, the tip with its target, and the cables."""
    plots = [
        blueprint.TimeSeriesView(origin=f"{NUMBERS}/{name}", name=title)
        for name, title in {
            "sensor/states": "Module ends [m]",
            "actions": "Cable displacements [m] or tensions [N]",
        }.items()
    ]
    return blueprint.Blueprint(
        blueprint.Horizontal(
            blueprint.Spatial3DView(origin=WORLD), blueprint.Vertical(*plots)
        )
    )
