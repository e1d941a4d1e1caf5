"""A recording's actions on a simulated arm: what it would have done in the recorded arm's place."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import States

# m, of arm files
MIN_TRAVEL = 0.0001
MAX_TRAVEL = 2.0


@dataclass(frozen=True)
class Replay:
    """How a recording is gone through again.

    Attributes:
        settling: seconds that every action is held, where rows are shapes at rest;
            none: each as long as it was.
        one_session: whether an episode goes on where the last one ended, and does not
            begin at rest.
        fidelity: of the simulation.
    """

    settling: float | None = None
    one_session: bool = False
    fidelity: str = "fast"


def replayed(arm: ArmSpec, episodes: Sequence[Episode], how: Replay) -> list[States]:
    """States of the simulated arm at every row of every episode, each of shape (rows, modules, 6).

    Raises:
        SimulationError: the simulated arm blew up.
    """
    with SimulatedRobot(_reaching(arm, episodes), how.fidelity) as robot:
        return [
            _one_replayed(robot, episode, how, number == 0)
            for number, episode in enumerate(episodes)
        ]


def _reaching(arm: ArmSpec, episodes: Sequence[Episode]) -> ArmSpec:
    """The arm with limits that let through what was really sent."""
    if arm.actuation == "tension":
        return arm
    sent = [
        one[name]
        for one in episodes
        for name in ("actions", "sensor.cables")
        if name in one.columns
    ]
    farthest = np.nanmax(np.abs(np.concatenate(sent)), axis=(0, 2))
    modules = []
    for module, travel in zip(
        arm.modules, np.clip(farthest, MIN_TRAVEL, MAX_TRAVEL), strict=True
    ):
        cable = module.cable.model_copy(
            update={"travel": float(max(travel, module.cable.travel or 0.0))}
        )
        modules.append(module.model_copy(update={"cable": cable}))
    return arm.model_copy(update={"modules": tuple(modules)})


def _one_replayed(
    robot: SimulatedRobot, episode: Episode, how: Replay, opened: bool
) -> States:
    if not (opened or how.one_session):
        robot.open()
    _lead_in(robot, episode, how)
    states = [robot.states()]
    for action, seconds in zip(
        episode["actions"][:-1], _durations(episode, how), strict=True
    ):
        robot.send(action)
        robot.advance(seconds)
        states.append(robot.states())
    return np.array(states)


def _lead_in(robot: SimulatedRobot, episode: Episode, how: Replay) -> None:
    """To where the cables were in the first row, if that is known, and time to come to rest there."""
    cables = episode.get("sensor.cables")
    if (
        cables is not None
        and np.isfinite(cables[0]).all()
        and robot.arm.actuation == "displacement"
    ):
        robot.send(cables[0])
        robot.advance(how.settling or robot.arm.control_period)


def _durations(episode: Episode, how: Replay) -> Float[np.ndarray, " steps"]:
    steps = np.diff(episode["time"])
    return steps if how.settling is None else np.full(len(steps), how.settling)


def thinned(episodes: Sequence[Episode], rows: int) -> list[Episode]:
    """Every n-th row of shapes at rest, so that no more than about so many are left; the last action goes along."""
    every = max(1, int(np.ceil(sum(map(len, episodes)) / rows)))
    return (
        [_every(episode, every) for episode in episodes]
        if every > 1
        else list(episodes)
    )


def _every(episode: Episode, every: int) -> Episode:
    """An action leads to the row that follows it, so actions are those before the rows that are kept."""
    kept = np.arange(0, len(episode), every)
    columns = {name: values[kept] for name, values in episode.columns.items()}
    columns["actions"] = episode["actions"][np.append(kept[1:] - 1, kept[-1])]
    return replace(episode, columns=columns)
