"""Logs as a stranger would write them, of simulated arms: columns shuffled, some signs turned, frame of one's own."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.robots.simulation import SimulatedRobot

FRAME, BASE = (
    Rotation.from_euler("xyz", [100, 25, -60], degrees=True),
    np.array([0.4, -1.2, 0.7]),
)


@dataclass(frozen=True)
class Written:
    """A log and its map, and what is true of it.

    Attributes:
        log: the file.
        map: the text of the map.
        order: number of the cable (over all modules) in each column.
        signs: that each column was multiplied by.
        arm: that moved.
    """

    log: Path
    map: str
    order: np.ndarray
    signs: np.ndarray
    arm: ArmSpec


def recorded(path: Path, arm: ArmSpec, samples: int = 250) -> Recording:
    """Two episodes of a simulated arm."""
    return collect(
        path,
        arm,
        lambda seed: SimulatedRobot(arm, seed=seed),
        CollectOptions("motor", episodes=2, samples=samples),
    )


def written(
    folder: Path, recording: Recording, tip_alone: bool, signs_stated: bool = False
) -> Written:
    """The recording as a stranger's CSV."""
    random, arm = np.random.default_rng(0), recording.arm
    count = arm.module_count * arm.cable_count
    order, signs = random.permutation(count), random.choice([-1, 1], count)
    modules = [arm.module_count - 1] if tip_alone else list(range(arm.module_count))
    cables = 1e3 * signs * recording.sensor("cables").reshape(-1, count)[:, order]
    commands = 1e3 * signs * recording.actions.reshape(-1, count)[:, order]
    ends = recording.sensor("states").reshape(-1, arm.module_count, 6)[:, modules, :3]
    seen = FRAME.apply(ends.reshape(-1, 3)).reshape(len(ends), -1) + np.tile(
        BASE, len(modules)
    )
    length = recording.time.shape[1]
    time = 0.1 * np.arange(len(ends)) + 100.0 * (np.arange(len(ends)) // length)
    names = ["t", *(f"c{k}" for k in range(count)), *(f"m{k}" for k in range(count))]
    names += [f"{axis}{module}" for module in modules for axis in "xyz"]
    values = np.concatenate([time[:, None], commands, cables, seen], axis=1)
    np.savetxt(
        folder / "log.csv", values, "%.7g", ",", header=",".join(names), comments=""
    )
    return Written(
        folder / "log.csv",
        _map(arm, modules, signs if signs_stated else 0 * signs),
        order,
        signs,
        arm,
    )


def _map(arm: ArmSpec, modules: list[int], signs: np.ndarray) -> str:
    x, z = (FRAME.apply(axis).tolist() for axis in np.eye(3)[[0, 2]])
    lines = [
        f'[rows]\nkind = "timed"\ntime = "t"\n[arm]\nname = "found"\nmodules = {arm.module_count}\ncontrol_rate = 10'
    ]
    lines += [
        f"length = {arm.length}\ncoupled_cables = false\n[frame]\nx = {x}\nalong = {z}"
    ]
    for number in range(arm.module_count * arm.cable_count):
        lines += [
            f'[[drives]]\ncommanded = "c{number}"\nmeasured = "m{number}"\nunit = "mm"'
        ]
        lines += [f'positive = "{("unknown", "releases", "pulls")[signs[number]]}"']
    for module in modules:
        lines += [
            f'[[ends]]\nmodule = {module}\nposition = ["x{module}", "y{module}", "z{module}"]\nunit = "m"'
        ]
    return "\n".join(lines) + "\n"
