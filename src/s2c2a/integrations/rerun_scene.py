"""Scenes as entities of Rerun, for recordings and live streams."""

from collections.abc import Iterable, Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.cli.export_table import LOG_TIME, Columns
from s2c2a.integrations.scenes import StepScene, mesh_of
from s2c2a.obstacles import ROW
from s2c2a.spaces import POSITION, States
from s2c2a.viz.colors import DESIRED, OBSTACLE, module_colors, rgb
from s2c2a.viz.mounting import Mounting

TIME = "time"
"""Timeline [s]."""
WORLD = "world"
NUMBERS = "numbers"
"""Root of the numbers: `numbers/sensor/cables` holds those of the column."""
TARGET_SIZE = 0.01  # radius, as a share of the arm's length; looks
OPACITY = 150  # of obstacles, of 255; looks


class RerunScene:
    """Entities of one arm in a stream of Rerun."""

    def __init__(self, arm: ArmSpec, stream: Any):
        """Log what does not change: the world, whose z axis is up, and the arm in it.

        Args:
            arm: that is shown.
            stream: `rerun.RecordingStream`.
        """
        import rerun  # noqa: PLC0415  # an extra

        self._arm = arm
        self._stream = stream
        self._obstacles = np.zeros((0, ROW))
        self._named = set[str]()
        turn = Mounting.of(arm).turn
        stream.log(WORLD, rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log(WORLD, rerun.Transform3D(mat3x3=turn), static=True)

    def log_numbers(self, table: Columns) -> None:
        """Log the numbers of all steps: an entity for every column of an episode.

        Args:
            table: as `export_table.table_of` makes it; its times are `log_time`.
        """
        import rerun  # noqa: PLC0415  # an extra

        times = rerun.TimeColumn(TIME, duration=table[LOG_TIME])
        for path, names in self._entities(table):
            values = np.stack([table[name] for name in names], axis=1)
            scalars = rerun.Scalars.columns(scalars=values.reshape(-1))
            rows = scalars.partition([len(names)] * len(values))
            self._stream.send_columns(path, [times], rows)

    def log_step(self, scene: StepScene) -> None:
        """Log a scene and its numbers."""
        import rerun  # noqa: PLC0415  # an extra

        self.log(scene)
        for path, names in self._entities(scene.numbers):
            values = [scene.numbers[name] for name in names]
            self._stream.log(path, rerun.Scalars(values))

    def _entities(self, names: Iterable[str]) -> Iterator[tuple[str, list[str]]]:
        """Path and numbers of each column, whose names are logged before the first."""
        import rerun  # noqa: PLC0415  # an extra

        for column, parts in _columns(names).items():
            path = f"{NUMBERS}/{column.replace('.', '/')}"
            if path not in self._named:
                lines = rerun.SeriesLines(names=parts)
                self._stream.log(path, lines, static=True)
                self._named.add(path)
            yield path, parts

    def log(self, scene: StepScene) -> None:
        """Log what is drawn of a scene; obstacles where they change."""
        import rerun  # noqa: PLC0415  # an extra

        self._stream.set_time(TIME, duration=scene.time)
        if scene.states is not None:
            self._log_arm(scene.line, scene.states)
        targets = np.array(list(scene.targets.values())).reshape(-1, 3)
        size = TARGET_SIZE * self._arm.length
        spheres = rerun.Points3D(targets, radii=size, colors=[rgb(DESIRED)])
        self._stream.log(f"{WORLD}/targets", spheres)
        if not np.array_equal(scene.obstacles, self._obstacles):
            self._log_obstacles(scene)

    def _log_arm(self, line: np.ndarray, states: States) -> None:
        """The center line of every module in its color, and the ends."""
        import rerun  # noqa: PLC0415  # an extra

        modules = self._arm.module_count
        points = (len(line) - 1) // modules
        strips = [
            line[points * module : points * (module + 1) + 1]
            for module in range(modules)
        ]
        colors = [rgb(color) for color in module_colors(modules)]
        radii = per_module(self._arm, "cable_radius")
        lines = rerun.LineStrips3D(strips, colors=colors, radii=radii)
        self._stream.log(f"{WORLD}/arm", lines)
        ends = rerun.Points3D(states[:, POSITION], colors=colors)
        self._stream.log(f"{WORLD}/ends", ends)

    def _log_obstacles(self, scene: StepScene) -> None:
        import rerun  # noqa: PLC0415  # an extra

        self._obstacles = scene.obstacles
        points, triangles = mesh_of(scene.obstacles, self._arm.length)
        path = f"{WORLD}/obstacles"
        if not len(points):
            self._stream.log(path, rerun.Clear(recursive=False))
            return
        color = [*rgb(OBSTACLE), OPACITY]
        mesh = rerun.Mesh3D(
            vertex_positions=points, triangle_indices=triangles, albedo_factor=color
        )
        self._stream.log(path, mesh)


def _columns(names: Iterable[str]) -> dict[str, list[str]]:
    """Names of the numbers of each column: `actions.1.2` is one of `actions`."""
    columns: dict[str, list[str]] = {}
    for name in names:
        parts = list(takewhile(lambda part: not part.isdigit(), name.split(".")))
        columns.setdefault(".".join(parts), []).append(name)
    return columns


def save_to(stream: Any, file: Path) -> None:
    """Let a stream of Rerun write to a file, which is replaced, with the layout.

    Raises:
        OSError: the file cannot be written.
    """
    try:
        stream.save(file, default_blueprint=layout())
    except RuntimeError as error:
        raise OSError(str(error)) from error


def layout() -> Any:
    """Views of a recording: the scene, the tip with its target, and the cables."""
    from rerun import blueprint  # noqa: PLC0415  # an extra

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
