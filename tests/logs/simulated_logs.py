"""CSV logs of simulated arms: shuffled columns, reversed signs, another frame."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.robots.simulation import SimulatedRobot

FRAME = Rotation.from_euler("xyz", [100, 25, -60], degrees=True)
BASE = np.array([0.4, -1.2, 0.7])  # m
POSITIVE = {0: "unknown", 1: "releases", -1: "pulls"}  # displacement lengthens


@dataclass(frozen=True)
class SimulatedLog:
    """Log, its map, and the true values.

    Attributes:
        path: the log file.
        map: text of the map.
        order: index of the cable (over all modules) in each column.
        signs: sign of each column.
        arm: simulated arm.
    """

    path: Path
    map: str
    order: np.ndarray
    signs: np.ndarray
    arm: ArmSpec


def record(path: Path, arm: ArmSpec, samples: int = 250) -> Recording:
    """Two episodes of a simulated arm."""
    return collect(
        path,
        arm,
        lambda seed: SimulatedRobot(arm, seed=seed),
        CollectOptions("motor", episodes=2, samples=samples),
    )


def write_log(
    folder: Path,
    recording: Recording,
    tip_only: bool,
    signs_stated: bool = False,
    shuffled: bool = True,
) -> SimulatedLog:
    """Write a recording as CSV; if it is not shuffled, all displacements lengthen."""
    random = np.random.default_rng(0)
    arm = recording.arm
    count = arm.module_count * arm.cable_count
    order = random.permutation(count) if shuffled else np.arange(count)
    signs = random.choice([-1, 1] if shuffled else [1], count)
    modules = list(range(arm.module_count))
    if tip_only:
        modules = modules[-1:]
    cables = 1e3 * signs * recording.sensor("cables").reshape(-1, count)[:, order]
    commands = 1e3 * signs * recording.actions.reshape(-1, count)[:, order]
    ends = recording.sensor("states").reshape(-1, arm.module_count, 6)[:, modules, :3]
    rows = len(ends)
    positions = FRAME.apply(ends.reshape(-1, 3)).reshape(rows, -1)
    positions += np.tile(BASE, len(modules))
    # a pause of 100 s between episodes
    episode = np.arange(rows) // recording.time.shape[1]
    time = 0.1 * np.arange(rows) + 100.0 * episode
    names = ["t", *(f"c{k}" for k in range(count)), *(f"m{k}" for k in range(count))]
    names += [f"{axis}{module}" for module in modules for axis in "xyz"]
    values = np.concatenate([time[:, None], commands, cables, positions], axis=1)
    path = folder / "log.csv"
    np.savetxt(path, values, "%.7g", ",", header=",".join(names), comments="")
    stated = signs if signs_stated else 0 * signs
    return SimulatedLog(path, _map_text(arm, modules, stated), order, signs, arm)


def _map_text(arm: ArmSpec, modules: list[int], signs: np.ndarray) -> str:
    lines = [
        "[rows]",
        'kind = "timed"',
        'time = "t"',
        "[arm]",
        'name = "found"',
        f"modules = {arm.module_count}",
        "control_rate = 10",
        f"length = {arm.length}",
        "coupled_cables = false",
        "[frame]",
        f"x = {FRAME.apply([1, 0, 0]).tolist()}",
        f"along = {FRAME.apply([0, 0, 1]).tolist()}",
    ]
    for index, sign in enumerate(signs):
        lines += [
            "[[drives]]",
            f'commanded = "c{index}"',
            f'measured = "m{index}"',
            'unit = "mm"',
            f'positive = "{POSITIVE[int(sign)]}"',
        ]
    for module in modules:
        lines += [
            "[[ends]]",
            f"module = {module}",
            f'position = ["x{module}", "y{module}", "z{module}"]',
            'unit = "m"',
        ]
    return "\n".join(lines) + "\n"
