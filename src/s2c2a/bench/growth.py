"""How times grow: modules, cables, obstacles, waypoints. Networks are untrained, since speed asks for shapes alone."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.bench.measurement import Growth, Limit, Measurement, growing, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.plan import following, planner_of
from s2c2a.bench.timing import Call, Progress, taken_in_turn
from s2c2a.planning import Goal
from s2c2a.spaces import Reading
from s2c2a.strategies import TrainedNetworks, recipe_named, s2c2a_strategy
from s2c2a.strategies.s2c2a import blank_networks
from s2c2a.tasks import Task, circle, load_waypoints, out_of_reach, waypoints_task

RECIPES = ("best", "paper")
MODULES, FEW_MODULES = (1, 2, 3, 5, 10, 20), (1, 2)
CABLES, FEW_CABLES = (3, 4, 6, 8), (3, 4)
OBSTACLES, FEW_OBSTACLES = (0, 1, 2, 4, 8, 16, 32, 64), (0, 1, 64)
WAYPOINTS, FEW_WAYPOINTS = (100, 1000, 10_000, 100_000), (100, 1000)
SHARE_OF_REPEATS = 5  # one of so many at every size: 1000 repeats make 200

Measured = Measurement | Growth


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measured]:
    """Each thing in turn grows while the rest of the arm stays as it is."""
    few, repeats = options.quick, max(1, options.repeats // SHARE_OF_REPEATS)
    yield from with_modules(options.arm, FEW_MODULES if few else MODULES, repeats, progress)
    yield from with_cables(options.arm, FEW_CABLES if few else CABLES, repeats, progress)
    yield from with_obstacles(options.arm, FEW_OBSTACLES if few else OBSTACLES, repeats, progress)
    yield from with_waypoints(
        options.arm, FEW_WAYPOINTS if few else WAYPOINTS, max(1, options.long_repeats // 2), progress
    )


def with_modules(arm: ArmSpec, sizes: Sequence[int], repeats: int, progress: Progress) -> Iterator[Measured]:
    """Plans and whole ticks of arms that are this arm's modules over and over."""
    arms = {size: arm_of_modules(arm, size) for size in sizes}
    yield from _growing_arms("modules", arms, repeats, progress)


def with_cables(arm: ArmSpec, sizes: Sequence[int], repeats: int, progress: Progress) -> Iterator[Measured]:
    """Plans and whole ticks of arms with so many even cables a module."""
    arms = {size: arm_of_cables(arm, size) for size in sizes}
    yield from _growing_arms("cables", arms, repeats, progress)


def with_obstacles(arm: ArmSpec, sizes: Sequence[int], repeats: int, progress: Progress) -> Iterator[Measured]:
    """Plans among so many obstacles."""
    for recipe in RECIPES:
        planner = planner_of(untrained(arm, recipe))
        calls = {str(size): following(planner, among_obstacles(arm, size)) for size in sizes}
        times = taken_in_turn(calls, repeats, partial(progress, f"obstacles, {recipe}"))
        yield from growing("obstacles", f"plan, {recipe}", sizes, list(times.values()), Limit(1.0))


def with_waypoints(arm: ArmSpec, sizes: Sequence[int], repeats: int, progress: Progress) -> Iterator[Measured]:
    """Reading a file of waypoints, one a control step, making a task of it, and checking the reach."""
    with TemporaryDirectory() as folder:
        files = [_waypoints_file(Path(folder) / f"{size}.csv", arm, size) for size in sizes]
        for what, work in (("read and make a task", _task_of), ("check the reach", _reach_of)):
            calls = {path.name: partial(_done, work, arm, path) for path in files}
            times = taken_in_turn(calls, repeats, partial(progress, f"waypoints: {what}"))
            yield from growing("waypoints", what, sizes, list(times.values()))


def _growing_arms(of: str, arms: dict[int, ArmSpec], repeats: int, progress: Progress) -> Iterator[Measured]:
    """Compilation at every size, then plans and ticks of all sizes in turn."""
    for recipe in RECIPES:
        plans, ticks = {}, {}
        for number, (size, arm) in enumerate(arms.items()):
            progress(f"{of}: compiling, {recipe}", number, len(arms))
            began = time.perf_counter()
            networks = untrained(arm, recipe)
            plans[str(size)] = following(planner_of(networks), circle(arm).goals)
            ticks[str(size)] = _ticking(networks)
            yield timing(f"compiling, {recipe}, {size} {of}", np.array([time.perf_counter() - began]))
        progress(f"{of}: compiling, {recipe}", len(arms), len(arms))
        for what, calls in (("plan", plans), ("whole tick", ticks)):
            times = taken_in_turn(calls, repeats, partial(progress, f"{of}: {what}, {recipe}"))
            limit = Limit(1.0) if (of, what) == ("modules", "plan") else None
            yield from growing(of, f"{what}, {recipe}", list(arms), list(times.values()), limit)


def arm_of_modules(arm: ArmSpec, count: int) -> ArmSpec:
    """The arm's modules over and over, from base to tip, each so much shorter that the arm's length stays."""
    kinds = [arm.modules[number % arm.module_count] for number in range(count)]
    scale = arm.length / sum(module.length for module in kinds)
    modules = [module.model_copy(update={"length": scale * module.length}) for module in kinds]
    return _changed(arm, f"{arm.name}-{count}-modules", modules)


def arm_of_cables(arm: ArmSpec, count: int) -> ArmSpec:
    """The arm with so many cables in every module, evenly spread from where its first one was."""
    modules = []
    for module in arm.modules:
        angles = module.cable_angles_deg[0] + 360.0 * np.arange(count) / count
        modules.append(module.model_copy(update={"cable_angles_deg": tuple(angles.tolist())}))
    return _changed(arm, f"{arm.name}-{count}-cables", modules)


def _changed(arm: ArmSpec, name: str, modules: Iterable) -> ArmSpec:
    """Another arm with these modules, checked anew; coupling of sensors is for the arm that it was given for."""
    values = arm.model_dump() | {"name": name, "sensing_coupling": None}
    return ArmSpec.model_validate(values | {"modules": [module.model_dump() for module in modules]})


def untrained(arm: ArmSpec, recipe: str) -> TrainedNetworks:
    """Networks of the recipe's shapes with random weights."""
    chosen = recipe_named(recipe)
    return TrainedNetworks(arm, chosen, 0, *blank_networks(arm, chosen), percent={}, curves={})


def among_obstacles(arm: ArmSpec, count: int) -> tuple[Goal, ...]:
    """The circle with so many obstacles about it, none so near that the tip could not go round."""
    random = np.random.default_rng(0)
    directions = random.normal(size=(64, 3))
    centres = arm.length * directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    thresholds = np.full(64, 0.02 * arm.length)
    return tuple(goal.with_obstacles(centres[:count], thresholds[:count]) for goal in circle(arm).goals)


def _ticking(networks: TrainedNetworks) -> Call:
    """Whole ticks at rest; an untrained strategy is not let near an arm."""
    arm = networks.arm
    strategy, task = s2c2a_strategy(networks), circle(arm)
    straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
    reading = Reading(0.0, np.zeros((arm.module_count, arm.cable_count)), configurations=straight)
    strategy.start(reading)
    return lambda number: strategy.step(reading, task.goals[number % len(task.goals)])


def _waypoints_file(path: Path, arm: ArmSpec, count: int) -> Path:
    """The circle at so many control steps."""
    positions = circle(arm).wanted_positions()[:, -1]
    times = np.arange(1, count + 1) / arm.control_rate
    rows = np.column_stack([times, positions[np.arange(count) % len(positions)]])
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header="time,x,y,z", comments="")
    return path


def _done(work: Callable[[ArmSpec, Path], object], arm: ArmSpec, path: Path, number: int) -> None:
    work(arm, path)


def _task_of(arm: ArmSpec, path: Path) -> Task:
    return waypoints_task(path.stem, load_waypoints(path), arm)


def _reach_of(arm: ArmSpec, path: Path) -> object:
    return jax.block_until_ready(out_of_reach(load_waypoints(path), arm))
