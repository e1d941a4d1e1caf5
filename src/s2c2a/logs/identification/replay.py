"""Replay of a recording's actions on a simulated arm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import States

# limits of `cable.travel` in arm files
MIN_TRAVEL = 0.0001  # m
MAX_TRAVEL = 2.0  # m


@dataclass(frozen=True)
class Replay:
    """Options of a replay.

    Attributes:
        settling: time to hold each action if rows are poses at rest [s]; None: as
            recorded.
        one_take: whether an episode continues the last one, instead of starting at
            rest.
        fidelity: fidelity of the simulation.
    """

    settling: float | None = None
    one_take: bool = False
    fidelity: str = "fast"


def replayed(
    arm: ArmSpec, episodes: Sequence[Episode], options: Replay
) -> list[States]:
    """States of the simulated arm in each episode, each of shape (rows, modules, 6).

    Raises:
        SimulationError: the simulation diverges.
    """
    results: list[States] = []
    with SimulatedRobot(_widen_travel(arm, episodes), options.fidelity) as robot:
        for episode in episodes:
            if results and not options.one_take:
                robot.open()
            _move_to_first_row(robot, episode, options)
            states = [robot.states()]
            durations = np.diff(episode["time"])
            if options.settling is not None:
                durations = np.full(len(durations), options.settling)
            for action, duration in zip(
                episode["actions"][:-1], durations, strict=True
            ):
                robot.step(action, duration)
                states.append(robot.states())
            results.append(np.array(states))
    return results


def _widen_travel(arm: ArmSpec, episodes: Sequence[Episode]) -> ArmSpec:
    """Arm whose travel limits include all recorded displacements."""
    if arm.actuation != "displacement":
        return arm
    displacements = [
        episode[name]
        for episode in episodes
        for name in ("actions", "sensor.cables")
        if name in episode.columns
    ]
    largest = np.nanmax(np.abs(np.concatenate(displacements)), axis=(0, 2))
    largest = np.clip(largest, MIN_TRAVEL, MAX_TRAVEL)
    modules = []
    for module, travel in zip(arm.modules, largest, strict=True):
        travel = float(max(travel, module.cable.travel or 0.0))
        cable = module.cable.model_copy(update={"travel": travel})
        modules.append(module.model_copy(update={"cable": cable}))
    return arm.model_copy(update={"modules": tuple(modules)})


def _move_to_first_row(
    robot: SimulatedRobot, episode: Episode, options: Replay
) -> None:
    """Send the measured displacements of the first row, if they are known."""
    cables = episode.get("sensor.cables")
    if cables is None or robot.arm.actuation != "displacement":
        return
    if np.isfinite(cables[0]).all():
        robot.step(cables[0], options.settling or robot.arm.control_period)


def thinned(episodes: Sequence[Episode], rows: int) -> list[Episode]:
    """Every n-th row of poses at rest, so that about this many rows remain."""
    total = sum(len(episode) for episode in episodes)
    stride = max(1, int(np.ceil(total / rows)))
    if stride == 1:
        return list(episodes)
    return [_thin(episode, stride) for episode in episodes]


def _thin(episode: Episode, stride: int) -> Episode:
    """Every n-th row, with the actions that lead to these rows."""
    rows = np.arange(0, len(episode), stride)
    columns = {name: values[rows] for name, values in episode.columns.items()}
    # an action leads to the row after it
    sent = np.append(rows[1:] - 1, rows[-1])
    columns["actions"] = episode["actions"][sent]
    return replace(episode, columns=columns)
