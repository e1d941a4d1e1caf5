"""Scenes: obstacles in a TOML file, beside which any task can run.

Each obstacle is a table `[[obstacles]]` with its kind; docs/guides/obstacles.md shows
them. Files hold lengths in meters, base frame, and name no code.
"""

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePath
from typing import Annotated, ClassVar, Literal

import numpy as np
from jaxtyping import Float
from pydantic import Field, PrivateAttr, TypeAdapter, model_validator
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.arm.fields import Free, Frozen, Number, between, optional
from s2c2a.errors import TargetError, counted
from s2c2a.files.text import read_text
from s2c2a.goals import MAX_OBSTACLES, Goal
from s2c2a.obstacles import (
    CENTER,
    CORE,
    DISC,
    HALF_EDGES,
    HALF_SPACE,
    SKIN,
    THRESHOLD,
    TURN,
    Row,
    distances,
    turns_to,
)
from s2c2a.tasks.meshes import Cover, covering_spheres
from s2c2a.tasks.task import Score, Task

Rows = Float[np.ndarray, "rows 12"]
RowsOverTime = Float[np.ndarray, "steps rows 12"]
Times = Float[np.ndarray, " steps"]
MESH_SIZES = (1e-3, 20.0)
"""Longest edges of meshes [m]: of a screw's head and of a room; else a unit is wrong."""
CLEARANCES = Score("clearance"), Score("clearance of the arm")
Point = tuple[Free, Free, Free]


def _size(meaning: str) -> Number:
    """Declare a size of a solid: from a wire to a building."""
    return between(SKIN, 100, "m", meaning)


class _OfScene(Frozen):
    """Table of a scene file."""

    fault_type = TargetError
    described = "scene (obstacles count from 0)"


class Solid(_OfScene):
    """An obstacle of any kind."""

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(
        ("clearance", "appears", "disappears", "velocity")
    )

    clearance: Number = between(0, 10, "m", "distance kept from its surface", 0.0)
    appears: Number = between(0, 1e6, "s", "time when it appears", 0.0)
    disappears: Number | None = between(0, 1e6, "s", "when it disappears", None)
    velocity: Point = optional("constant velocity [m/s]", (0.0, 0.0, 0.0))

    def rows(self) -> Rows:
        """Rows of the goal (`s2c2a.obstacles`), at time zero."""
        rows = np.array(self._rows(), float)
        rows[:, THRESHOLD] += self.clearance
        return rows

    def rows_at(self, times: Times) -> RowsOverTime:
        """Rows at times [s]; with a threshold of zero while it is absent."""
        rows = np.tile(self.rows(), (len(times), 1, 1))
        rows[..., CENTER] += times[:, None, None] * np.array(self.velocity)
        end = np.inf if self.disappears is None else self.disappears
        is_present = (times >= self.appears) & (times < end)
        rows[~is_present, :, THRESHOLD] = 0.0
        return rows

    def gap_of_base(self) -> float:
        """Distance of the base from where it first appears [m], negative within it."""
        rows = self.rows_at(np.array([self.appears]))[0]
        gaps = distances(np.zeros(3), rows[:, CENTER], rows[:, CORE])
        return float((gaps - rows[:, THRESHOLD]).min()) + self.clearance

    def _rows(self) -> Sequence[Row]:
        """Rows without the clearance."""
        raise NotImplementedError


class Sphere(Solid):
    """All points within a radius of a center."""

    kind: Literal["sphere"] = "sphere"
    center: Point = Field(description="center [m]")
    radius: Number = _size("radius")

    def _rows(self) -> Sequence[Row]:
        return [_row(self.center, self.radius)]


class _Rod(Solid):
    """A solid around the segment from a start to an end."""

    start: Point = Field(description="start of its axis [m]")
    end: Point = Field(description="end of its axis [m]")
    radius: Number = _size("radius")

    @model_validator(mode="after")
    def _validate(self):
        if self.start == self.end:
            raise ValueError(
                "start and end are the same point; give the ends of its axis"
            )
        return self

    def _along(self, threshold: float, disc: float) -> Row:
        """The row of a core around the axis."""
        axis = np.subtract(self.end, self.start)
        center = np.add(self.start, self.end) / 2.0
        half_edges = [0.0, 0.0, np.linalg.norm(axis) / 2.0]
        return _row(center, threshold, turns_to(axis), half_edges, disc)


class Capsule(_Rod):
    """All points within a radius of a segment."""

    kind: Literal["capsule"] = "capsule"

    def _rows(self) -> Sequence[Row]:
        return [self._along(self.radius, 0.0)]


class Cylinder(_Rod):
    """A cylinder with flat ends."""

    kind: Literal["cylinder"] = "cylinder"

    def _rows(self) -> Sequence[Row]:
        return [self._along(SKIN, self.radius)]


class _Turned(Solid):
    """A solid with an orientation."""

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(
        (*Solid.omitted_defaults, "rotation_deg")
    )

    rotation_deg: Point = optional(
        "rotation about the fixed axes x, y, z [deg]", (0.0, 0.0, 0.0)
    )

    @property
    def _turn(self) -> Rotation:
        return Rotation.from_euler("xyz", self.rotation_deg, degrees=True)


class Box(_Turned):
    """A box with sharp edges."""

    kind: Literal["box"] = "box"
    center: Point = Field(description="center [m]")
    size: tuple[Number, Number, Number] = Field(description="lengths of its edges [m]")

    @model_validator(mode="after")
    def _validate(self):
        if min(self.size) < SKIN or max(self.size) > HALF_SPACE:
            raise ValueError(
                f"size {list(self.size)} has an edge that is not between {SKIN:g} and "
                f"{HALF_SPACE:g} m; for a wall without end, use the kind half_space"
            )
        return self

    def _rows(self) -> Sequence[Row]:
        half = np.array(self.size) / 2.0
        return [_row(self.center, SKIN, self._turn.as_quat(), half)]


class HalfSpace(Solid):
    """Everything behind a plane, such as a wall or a table."""

    kind: Literal["half_space"] = "half_space"
    point: Point = Field(description="a point of the plane [m]")
    normal: Point = Field(description="direction away from the solid, of any length")

    @model_validator(mode="after")
    def _validate(self):
        if np.linalg.norm(self.normal) < SKIN:
            raise ValueError("normal is zero; give a direction such as [0, 0, 1]")
        if np.linalg.norm(self.point) > HALF_SPACE / 2.0:
            raise ValueError(
                f"point {list(self.point)} is more than {HALF_SPACE / 2.0:g} m from the "
                "base; lengths are in meters"
            )
        return self

    def _rows(self) -> Sequence[Row]:
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        center = (normal @ self.point - HALF_SPACE) * normal
        return [_row(center, SKIN, turns_to(normal), np.full(3, HALF_SPACE))]


class Mesh(_Turned):
    """The solid that a file of triangles encloses, covered by spheres."""

    kind: Literal["mesh"] = "mesh"
    file: str = Field(description="STL, OBJ, PLY, GLB or OFF, beside the scene file")
    scale: Number = between(1e-6, 1e6, "m", "length of the file's unit", 1.0)
    position: Point = optional("of the file's origin [m]", (0.0, 0.0, 0.0))
    spheres: int = between(1, MAX_OBSTACLES, "1", "most that cover it", 16)
    _folder: Path = PrivateAttr(default=Path())

    @model_validator(mode="after")
    def _validate(self):
        path = PurePath(self.file)
        if path.is_absolute() or ".." in path.parts:
            raise ValueError(
                f"file {self.file} is not beside the scene file; write a path from there"
            )
        return self

    @property
    def excess(self) -> float:
        """By how much the spheres stand out at most [m]."""
        return self.scale * self._cover.excess

    def __str__(self) -> str:
        """Name and size."""
        x, y, z = self.scale * self._cover.edges
        return f"{self.file}, {x:.3g} x {y:.3g} x {z:.3g} m with scale = {self.scale:g}"

    @property
    def _cover(self) -> Cover:
        return covering_spheres(self._folder / self.file, self.spheres)

    def _rows(self) -> Sequence[Row]:
        local = self.scale * self._cover.spheres
        centers = self._turn.apply(local[:, :3]) + self.position
        return [_row(*sphere) for sphere in zip(centers, local[:, 3], strict=True)]


AnySolid = Sphere | Capsule | Cylinder | Box | HalfSpace | Mesh
Kept = Annotated[AnySolid, Field(discriminator="kind")]
SOLID: TypeAdapter[AnySolid] = TypeAdapter(Kept)


class Scene(_OfScene):
    """Obstacles, at most `MAX_OBSTACLES`."""

    obstacles: tuple[Kept, ...] = Field(description="tables [[obstacles]]")

    def rows_at(self, times: Times) -> RowsOverTime:
        """Rows of all obstacles at times [s]."""
        solids = [solid.rows_at(times) for solid in self.obstacles]
        return np.concatenate([np.zeros((len(times), 0, 12)), *solids], axis=1)

    def remarks(self) -> Iterator[str]:
        """One sentence about each mesh."""
        for solid in self.obstacles:
            if isinstance(solid, Mesh):
                yield (
                    f"{solid} is covered by {counted(len(solid.rows()), 'sphere')}, "
                    f"up to {1000 * solid.excess:.0f} mm beyond it"
                )

    def around(self, task: Task, arm: ArmSpec) -> Task:
        """The task beside these obstacles, whose clearance is scored, too.

        Raises:
            TargetError: both together have too many obstacles, or see `Task.check`.
        """
        names = task.obstacle_names()
        for table, solid in enumerate(self.obstacles):
            names += [f"obstacle {table} of the scene (counted from 0)"] * len(
                solid.rows()
            )
        times = arm.control_period * np.arange(1, len(task.goals) + 1)
        goals = goals_beside(task.goals, self.rows_at(times))
        known = {score.metric for score in task.scores}
        missing = [score for score in CLEARANCES if score.metric not in known]
        scores = *task.scores, *missing
        around = replace(task, goals=goals, scores=scores, solids=tuple(names))
        around.check(arm)
        return around


def goals_beside(goals: Sequence[Goal], rows: Rows) -> tuple[Goal, ...]:
    """Goals with further obstacles; their own stay, before these.

    Args:
        goals: of successive control steps.
        rows: of all goals, or of each; with a threshold of zero they are absent.

    Raises:
        TargetError: too many.
    """
    added = np.broadcast_to(rows, (len(goals), *rows.shape[-2:]))
    own = Goal.stacked(goals).obstacles_in_use()
    everything = np.concatenate([own, added], axis=1)
    _check_count(everything.shape[1], "task and scene together")
    return tuple(
        goal.with_obstacles(
            each[:, CENTER],
            each[:, THRESHOLD],
            float(goal.obstacle_weight),
            each[:, CORE],
        )
        for goal, each in zip(goals, everything, strict=True)
    )


def load_scene(path: str | os.PathLike) -> Scene:
    """Read a scene file.

    Raises:
        TargetError: no file, invalid TOML, an unknown key or kind, an invalid value, a
            mesh that cannot be read, or too many obstacles.
    """
    if not Path(path).is_file():
        raise TargetError(f"no scene file {path}; docs/guides/obstacles.md shows one")
    scene = Scene.from_toml(read_text(path, TargetError), str(path))
    for solid in scene.obstacles:
        if isinstance(solid, Mesh):
            solid._folder = Path(path).parent
    _check_count(sum(len(solid.rows()) for solid in scene.obstacles), str(path))
    for number, solid in enumerate(scene.obstacles):
        name = f"{path}: the {solid.kind} of obstacle {number} (counted from 0)"
        unit = ""
        if isinstance(solid, Mesh):
            unit = f" ({solid}; a file in millimeters needs scale = 0.001)"
            low, high = MESH_SIZES
            if not low < solid.scale * solid._cover.edges.max() < high:
                raise TargetError(f"{name} has an unlikely size{unit}")
        if solid.gap_of_base() < -2 * SKIN:  # the arm may stand on it
            raise TargetError(
                f"{name} contains the base of the arm at 0, 0, 0{unit}; no shape is "
                "clear of it"
            )
    return scene


def _row(center, threshold: float, turn=0.0, half_edges=0.0, disc=0.0) -> Row:
    """A row of its parts (`s2c2a.obstacles`)."""
    row = np.zeros(12)
    row[CENTER], row[THRESHOLD] = center, threshold
    core = row[CORE]
    core[TURN], core[HALF_EDGES], core[DISC] = turn, half_edges, disc
    return row


def _check_count(count: int, what: str) -> None:
    if count > MAX_OBSTACLES:
        raise TargetError(
            f"{what} would have {count} obstacles, and at most {MAX_OBSTACLES} are "
            "allowed; leave some out, or cover meshes by fewer spheres"
        )
