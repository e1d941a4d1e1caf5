"""What viewers show of a control step: the arm, targets, obstacles and numbers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import center_line, per_module
from s2c2a.cli.export_table import LOG_TIME, Columns, table_of
from s2c2a.episodes import Episode
from s2c2a.live.reconstruction import completed
from s2c2a.obstacles import ROW, rows_of
from s2c2a.runtime import StepRecord
from s2c2a.runtime.record import build_piece
from s2c2a.spaces import POSITION, States
from s2c2a.viz.solids import Points, hull, surface
from s2c2a.viz.trace import standing

Triangles = tuple[Points, Int[np.ndarray, "triangles 3"]]


@dataclass(frozen=True, eq=False)
class StepScene:
    """One control step; base frame.

    Attributes:
        time: since the first step of the recording; goes on from episode to episode [s].
        states: end position [m] and axis of every module, complete; None if no end is
            known. What was not measured is reconstructed by arcs.
        line: center line from base to tip [m], shape (points, 3); empty if not known.
        targets: desired positions [m], by number of the module from 1.
        obstacles: rows of obstacles that stand (`s2c2a.obstacles`), shape (..., 12).
        numbers: of all columns, by name; SI units, NaN where there is none.
    """

    time: float
    states: States | None
    line: Points
    targets: dict[int, np.ndarray]
    obstacles: Float[np.ndarray, "obstacles 12"]
    numbers: dict[str, float]


def scenes_of(episodes: Sequence[Episode]) -> Iterator[StepScene]:
    """A scene for every step of every episode."""
    table = table_of(episodes)
    row = 0
    for episode in episodes:
        for step in range(len(episode)):
            yield _scene(episode, step, _numbers(table, row))
            row += 1


def scene_of(record: StepRecord, arm: ArmSpec, time: float) -> StepScene:
    """The scene of a step of a running control loop.

    Args:
        record: of the step.
        arm: that is controlled.
        time: of the scene [s].
    """
    episode = build_piece([record], arm)
    numbers = _numbers(table_of([episode]), 0)
    return _scene(episode, 0, numbers | {LOG_TIME: time})


def mesh_of(obstacles: Float[np.ndarray, "obstacles 12"], shown: float) -> Triangles:
    """Triangles of all obstacles together.

    Args:
        obstacles: rows that stand.
        shown: half the edge of the part of a half-space that is drawn [m].
    """
    points: list[np.ndarray] = [np.zeros((0, 3))]
    triangles: list[np.ndarray] = [np.zeros((0, 3), int)]
    for row in obstacles:
        corners, faces = _solid(row.tobytes(), shown)
        triangles.append(faces + sum(map(len, points)))
        points.append(corners)
    return np.concatenate(points), np.concatenate(triangles)


@lru_cache(maxsize=256)  # most obstacles stand still
def _solid(row: bytes, shown: float) -> Triangles:
    return hull(surface(np.frombuffer(row), shown))


def _numbers(table: Columns, row: int) -> dict[str, float]:
    return {name: float(values[row]) for name, values in table.items()}


def _scene(episode: Episode, step: int, numbers: dict[str, float]) -> StepScene:
    lengths = per_module(episode.arm, "length")
    states = None
    line = np.zeros((0, 3))
    for name in ("sensor.states", "predicted"):  # else those that the plan leads to
        rows = episode.get(name)
        if rows is not None and np.isfinite(rows[step, :, POSITION]).any():
            states = completed(rows[step].astype(float), lengths)
            line = np.vstack([np.zeros(3), center_line(states, lengths)])
            break
    targets = {}
    positions = episode.get("desired_positions")
    if positions is not None:
        for number, position in enumerate(positions[step], 1):
            if np.isfinite(position).all():
                targets[number] = position
    obstacles = np.zeros((0, ROW))
    rows = episode.get("obstacles")
    if rows is not None:
        obstacles = rows_of(rows[step].astype(float))
        obstacles = obstacles[standing(obstacles)]
    time = numbers[LOG_TIME]
    return StepScene(
        time=time,
        states=states,
        line=line,
        targets=targets,
        obstacles=obstacles,
        numbers=numbers,
    )
