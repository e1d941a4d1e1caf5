"""Scenes: whether the whole arm finds its way past obstacles, and how far it goes.

A drawn scene has a way by construction: obstacles keep away from an arm of arcs that goes
from rest over a drawn shape to the shape that has the target at its tip. They are put on
the way that goes there straight on.

An unsolvable scene has no way by construction: its target is in a closed cage of spheres
that the arm is outside of, deep in one sphere, or farther away than the arm is long. All
clear tips stay more than 3 cm away from it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import jax
import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a import jobs
from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import center_line
from s2c2a.evaluation import Row
from s2c2a.kinematics import states_from_bends
from s2c2a.obstacles import CENTER, CORE, ROW, THRESHOLD, distances, rows_of
from s2c2a.planning import Goal, Outcome
from s2c2a.robots import RobotFactory
from s2c2a.strategies import RunOptions, recipe_named
from s2c2a.tasks import Score, Task, load_task
from s2c2a.tasks.scenes import SOLID, goals_beside
from s2c2a_experiments.run_rows import metric_rows
from s2c2a_experiments.shapes import drawn_directions

EXPERIMENT = "scenes"
TURNED = ("reach-1", "reach-2", "risk-a", "risk-c")
TURNS_DEG = (40.0, 160.0, 275.0)
SCENE_TIME = 15.0  # s
MOST_OBSTACLES = 8
RADII = (0.04, 0.12)  # of the arm's length
KINDS = "sphere", "capsule", "cylinder", "box", "half_space"
TRIES = 20  # of each solid
SHRINKING = (1.0, 0.7, 0.5, 0.35)  # of a drawn size
ROOM = 0.06  # of the arm's length, between obstacles and the way that exists
CROSSING_SPEED = 0.1  # m/s
CROSSING_TIME = 12.0  # s
TOUCHED = -0.2  # cm
NEAR = 1.0  # cm
UNSOLVABLE = ("caged", "covered", "too far")
CAGE_SPHERES = 48
CAGE = 0.14  # of the arm's length: from the target to the spheres' centers
CAGE_RADIUS = (
    0.6  # of that: neighbors overlap, and points 4 cm apart do not step across
)
COVER = (0.12, 0.2)  # of the arm's length, radius of the sphere with the target
DEEP = 0.07  # of the arm's length, of that target; 4 cm for one of 0.6 m
TOO_FAR = (1.1, 1.4)  # of the arm's length, from the base
TOLD_TIME = 2.0  # s from the start, in which a plan is to tell that there is no way
NO_WAY = (Outcome.BLOCKED, Outcome.OUT_OF_REACH)
SCORES = (
    Score("end distance"),
    Score("clearance of the arm"),
    Score("path length"),
)

Around = Callable[[np.ndarray, ArmSpec, np.random.Generator], np.ndarray]
"""(target [m], arm, random) -> centers and radii of spheres [m], shape (spheres, 4)."""


@dataclass(frozen=True)
class SceneStudy:
    """What is run.

    Attributes:
        arm: that goes past obstacles, all of it guarded.
        drawn: number of drawn scenes.
        crossings: number of spheres that cross the way.
        unsolvable: number of drawn scenes without a way.
        seeds: of data, training and start.
    """

    arm: ArmSpec
    drawn: int = 50
    crossings: int = 20
    unsolvable: int = 20
    seeds: tuple[int, ...] = (0, 1, 2)


def turned_task(name: str, arm: ArmSpec, degrees: float) -> Task:
    """A task turned about the vertical axis."""
    turn = np.deg2rad(degrees)
    matrix = np.array(
        [
            [np.cos(turn), -np.sin(turn), 0.0],
            [np.sin(turn), np.cos(turn), 0.0],
            [0.0, 0.0, 1.0],
        ]
    )
    task = load_task(name, arm)
    goals = [
        goal._replace(
            positions=np.asarray(goal.positions @ matrix.T, np.float32),
            obstacles=np.asarray(goal.obstacles @ matrix.T, np.float32),
        )
        for goal in task.goals
    ]
    named = f"{name}, turned by {degrees:g} deg"
    return replace(task, name=named, goals=tuple(goals), scores=SCORES)


def drawn_task(arm: ArmSpec, seed: int) -> Task:
    """A still target past drawn obstacles."""
    random = np.random.default_rng(seed)
    target, spheres = _drawn_scene(arm, random)
    return _still_task(f"drawn scene {seed}", target, spheres, arm)


def unsolvable_task(arm: ArmSpec, seed: int) -> Task:
    """A still target that no way leads to, of one of the kinds `UNSOLVABLE`."""
    random = np.random.default_rng([seed, 1])
    kind = UNSOLVABLE[seed % len(UNSOLVABLE)]
    if kind == "too far":
        target, spheres = _drawn_scene(arm, random)
        distance = random.uniform(*TOO_FAR) * arm.length
        target = target * distance / np.linalg.norm(target)
    else:
        around = _caging if kind == "caged" else _covering
        target, spheres = _closed_scene(arm, random, around)
    return _still_task(f"{kind} {seed}", target, spheres, arm)


def _still_task(name: str, target: np.ndarray, rows: np.ndarray, arm: ArmSpec) -> Task:
    (goal,) = goals_beside([Goal.of(arm.module_count)], rows_of(rows))
    steps = round(SCENE_TIME * arm.control_rate)
    return Task(name, (goal.with_position(target),) * steps, SCORES)


def _drawn_scene(
    arm: ArmSpec, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """A target with a way past solids of all kinds; their rows, shape (solids, 12)."""
    shapes = _drawn_bends(arm, random, 2)
    rest = np.zeros_like(shapes[0])
    free = _lines(arm, np.array([rest, *shapes]))
    straight = _lines(arm, np.array([rest, shapes[-1]]))
    count = int(random.integers(1, MOST_OBSTACLES + 1))
    solids = list(_solids_between(arm, free, straight, count, random))
    return free[-1, -1], np.reshape(solids, (-1, ROW))


def _closed_scene(
    arm: ArmSpec, random: np.random.Generator, around: Around
) -> tuple[np.ndarray, np.ndarray]:
    """A target within reach that spheres enclose; the arm at rest is clear of them."""
    while True:
        (shape,) = _drawn_bends(arm, random, 1)
        lines = _lines(arm, np.array([np.zeros_like(shape), shape]))
        target = lines[-1, -1]
        resting = np.append(lines[0], np.zeros((1, 3)), axis=0)
        spheres = around(target, arm, random)
        centers = spheres[:, :3]
        gaps = np.linalg.norm(resting[:, None] - centers, axis=-1)
        if (gaps - spheres[:, 3]).min() > ROOM * arm.length:
            return target, spheres


def _caging(
    target: np.ndarray, arm: ArmSpec, random: np.random.Generator
) -> np.ndarray:
    """Overlapping spheres around a target, evenly on a spiral."""
    heights = 1.0 - (2.0 * np.arange(CAGE_SPHERES) + 1.0) / CAGE_SPHERES
    angles = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(CAGE_SPHERES)
    angles = angles + random.uniform(0.0, 2.0 * np.pi)
    widths = np.sqrt(1.0 - heights**2)
    sides = [widths * np.cos(angles), widths * np.sin(angles), heights]
    distance = CAGE * arm.length
    centers = target + distance * np.stack(sides, axis=1)
    return np.insert(centers, 3, CAGE_RADIUS * distance, axis=1)


def _covering(
    target: np.ndarray, arm: ArmSpec, random: np.random.Generator
) -> np.ndarray:
    """A sphere in which the target is deep."""
    radius = random.uniform(*COVER) * arm.length
    direction = random.normal(size=3)
    aside = random.uniform(0.0, radius - DEEP * arm.length)
    center = target + aside * direction / np.linalg.norm(direction)
    return np.append(center, radius)[None]


def crossing_task(arm: ArmSpec, seed: int) -> Task:
    """A still target, and a sphere that crosses the arm at 10 cm/s."""
    random = np.random.default_rng(seed)
    (shape,) = _drawn_bends(arm, random, 1)
    line = _lines(arm, np.array([np.zeros_like(shape), shape]))[-1]
    place = line[random.integers(len(line) // 2, len(line))]
    angle = random.uniform(0.0, 2.0 * np.pi)
    velocity = CROSSING_SPEED * np.array([np.cos(angle), np.sin(angle), 0.0])
    radius = random.uniform(*RADII) * arm.length
    steps = round(CROSSING_TIME * arm.control_rate)
    times = np.arange(1, steps + 1) / arm.control_rate
    target = Goal.of(arm.module_count).with_position(line[-1])
    goals = [
        target.with_obstacles([place + velocity * (time - CROSSING_TIME / 2)], [radius])
        for time in times
    ]
    return Task(f"crossing sphere {seed}", tuple(goals), SCORES)


def scene_rows(study: SceneStudy, make: jobs.Make) -> list[Row]:
    """Rows of the turned scenes; of those drawn, and of the crossing spheres, shares.

    Args:
        study: what is run.
        make: finds or makes runs, networks and recordings.
    """
    turned = [
        turned_task(name, study.arm, degrees)
        for name in TURNED
        for degrees in (0.0, *TURNS_DEG)
    ]
    drawn = [drawn_task(study.arm, seed) for seed in range(study.drawn)]
    crossing = [crossing_task(study.arm, seed) for seed in range(study.crossings)]
    unsolvable = [unsolvable_task(study.arm, seed) for seed in range(study.unsolvable)]
    groups = [_jobs([task], study) for task in turned]
    groups += [_jobs(tasks, study) for tasks in (drawn, crossing, unsolvable)]
    *single, past, crossed, stopped = jobs.in_groups(make, groups)
    rows = [row for runs in single for row in jobs.score_rows(EXPERIMENT, runs)]
    for name, runs in (("drawn scenes", past), ("crossing spheres", crossed)):
        rows += _shares(name, runs)
    rows += _shares_told("drawn scenes", past)
    rows += _shares("unsolvable scenes", stopped)
    rows += _shares_told("unsolvable scenes", stopped)
    for kind in UNSOLVABLE:
        of_kind = [run for run in stopped if run.task.startswith(kind)]
        rows += _shares_told(f"unsolvable scenes, {kind}", of_kind)
    return rows


def _jobs(tasks: Sequence[Task], study: SceneStudy) -> list[jobs.Job]:
    conditions = jobs.Conditions(RobotFactory.simulation(), RunOptions("arm"))
    recipe = recipe_named("best")
    return jobs.jobs_for(tasks, study.arm, ["s2c2a"], study.seeds, recipe, conditions)


def _shares(name: str, runs: Sequence[jobs.Run]) -> list[Row]:
    """Shares of runs that reach their target, and that touch no obstacle."""
    if not runs:
        return []
    scores = [
        {row.metric: row.mean for row in jobs.score_rows(EXPERIMENT, [run])}
        for run in runs
    ]
    ends = np.array([score["end distance"] for score in scores])
    clearances = np.array([score["clearance of the arm"] for score in scores])
    metrics = {
        ("reached", "of runs"): [float(np.mean(ends < NEAR))],
        ("untouched", "of runs"): [float(np.mean(clearances > TOUCHED))],
        ("smallest clearance of the arm", "cm"): [float(clearances.min())],
    }
    return metric_rows(EXPERIMENT, runs[:1], "s2c2a", metrics, name)


def _shares_told(name: str, runs: Sequence[jobs.Run]) -> list[Row]:
    """Shares of runs whose plan tells that there is no way: soon, and at the end."""
    if not runs:
        return []
    tells = [np.isin(run.episode.ran("outcome"), NO_WAY) for run in runs]
    soon = round(TOLD_TIME * runs[0].job.arm.control_rate)
    metrics = {
        ("said unreachable within 2 s", "of runs"): [
            float(np.mean([told[:soon].any() for told in tells]))
        ],
        ("said unreachable at the end", "of runs"): [
            float(np.mean([told[-1] for told in tells]))
        ],
    }
    return metric_rows(EXPERIMENT, runs[:1], "s2c2a", metrics, name)


def _drawn_bends(arm: ArmSpec, random: np.random.Generator, count: int) -> np.ndarray:
    """Shapes at most 0.8 of the way to the bend limits, shape (count, modules, 2)."""
    limits = 0.8 * ArmGeometry.of(arm).bend_limits[:, None]
    return limits * drawn_directions(random, count, arm.module_count)


def _lines(arm: ArmSpec, corners: np.ndarray, steps: int = 12) -> np.ndarray:
    """Center lines [m] on the way over shapes, shape (shapes, points, 3)."""
    shares = np.linspace(0.0, 1.0, steps, endpoint=False)[:, None, None]
    pieces = [start + shares * (end - start) for start, end in pairwise(corners)]
    joined = np.concatenate([*pieces, corners[-1:]])
    bends = joined.astype(np.float32)
    lengths = np.asarray(ArmGeometry.of(arm).lengths, np.float32)
    return center_line(np.asarray(_states(bends, lengths)), lengths)


def _solids_between(
    arm: ArmSpec,
    free: np.ndarray,
    straight: np.ndarray,
    count: int,
    random: np.random.Generator,
) -> Iterator[np.ndarray]:
    """Solids on the straight way that leave room for the free one; fewer, if need be."""
    room = ROOM * arm.length
    tips = straight[:, -1]
    left = count
    for _ in range(TRIES * count):
        radius = random.uniform(*RADII) * arm.length
        tip = tips[random.integers(1, len(tips))]
        near = tip + random.normal(0.0, radius, 3)
        kind = KINDS[random.integers(len(KINDS))]
        turn = Rotation.random(random_state=random)
        for share in SHRINKING:  # until it leaves room
            size = share * radius
            axis = turn.apply([0.0, 0.0, 2.0 * size])
            rod = {"start": near - axis, "end": near + axis, "radius": 0.6 * size}
            angles = turn.as_euler("xyz", degrees=True)
            keys = {
                "sphere": {"center": near, "radius": size},
                "capsule": rod,
                "cylinder": rod,
                "box": {
                    "center": near,
                    "size": np.full(3, 1.6 * size),
                    "rotation_deg": angles,
                },
                "half_space": {"point": near, "normal": -near},
            }[kind]
            values = {name: np.asarray(value).tolist() for name, value in keys.items()}
            row = SOLID.validate_python({"kind": kind, **values}).rows()[0]
            gaps = distances(free, row[CENTER], row[CORE]) - row[THRESHOLD]
            if gaps.min() > room and left:
                left -= 1
                yield row
                break


_states = jax.jit(jax.vmap(states_from_bends, in_axes=(0, None)))
