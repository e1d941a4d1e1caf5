"""Controllers on a task, over seeds: rollouts and their rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Rollout, position_errors, rollout
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.experiments.paper import printed
from s2c2a.experiments.workshop import Progress, Workshop, quiet
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.strategies import Recipe, Strategy, TrainedNetworks, s2c2a_strategy
from s2c2a.tasks import task_named

MakeStrategy = Callable[[str, int], Strategy]

START_JITTER = 0.05
"""Part of the full bend that every module is moved by before a run settles at rest: the start's own seed."""


@dataclass(frozen=True)
class Run:
    """One controller's run with one seed.

    Attributes:
        controller: its name.
        seed: of data, training and start.
        rollout: what happened.
        errors: distance of the tip to its target [cm], one a step.
    """

    controller: str
    seed: int
    rollout: Rollout
    errors: Float[np.ndarray, " steps"]


def checked_seeds(first: int, count: int) -> range:
    """Seeds from the first one.

    Raises:
        S2C2AError: none, or a negative one.
    """
    if count < 1 or first < 0:
        raise S2C2AError(f"{count} seeds from {first} asked for; take at least one, from zero or above")
    return range(first, first + count)


def follow(
    task: str,
    arm: ArmSpec,
    controllers: Sequence[str],
    seeds: Sequence[int],
    make_strategy: MakeStrategy,
    *,
    fidelity: str = "fast",
    payload: float = 0.0,
    progress: Progress = quiet,
) -> list[Run]:
    """Let every controller work on a task, once a seed.

    Args:
        task: name of the task.
        arm: the arm to simulate.
        controllers: names.
        seeds: of data, training and start.
        make_strategy: a strategy for (controller, seed).
        fidelity: of the simulation that is driven.
        payload: at the tip [kg].
        progress: told of every step.

    Raises:
        S2C2AError: no such task, impossible payload; before anything is trained.
    """
    asked = task_named(task, arm)
    SimulatedRobot(arm, fidelity, payload=payload)
    runs = []
    for seed in seeds:
        for controller in dict.fromkeys(controllers):
            strategy = make_strategy(controller, seed)
            robot = SimulatedRobot(arm, fidelity, seed, payload, START_JITTER)
            told = partial(progress, f"{controller} on {task} with {arm.name}, seed {seed}")
            done = rollout(robot, strategy, asked, told)
            runs.append(Run(controller, seed, done, position_errors(done.states, done.task.wanted_positions())))
    return runs


def workshop_strategies(
    workshop: Workshop, arm: ArmSpec, recipe: Recipe, saved: TrainedNetworks | None = None
) -> MakeStrategy:
    """Strategies made or found by a workshop; for `s2c2a` the saved networks, if there are any."""

    def make(controller: str, seed: int) -> Strategy:
        if saved is not None and controller == "s2c2a":
            return s2c2a_strategy(saved)
        return workshop.strategy(controller, arm, recipe, seed)

    return make


def position_rows(experiment: str, arm: ArmSpec, runs: Sequence[Run], recipe: str, fidelity: str) -> list[Row]:
    """One row a controller: `position` [cm], with the arm's first mode beside it."""
    frequency, damping = first_mode(arm)
    rows = []
    for controller in dict.fromkeys(run.controller for run in runs):
        mine = [run for run in runs if run.controller == controller]
        task = mine[0].rollout.task.name
        rows.append(
            Row(
                experiment=experiment,
                task=task,
                arm=arm.name,
                fidelity=fidelity,
                controller=controller,
                recipe=recipe,
                metric="position",
                unit="cm",
                **over_seeds([run.errors for run in mine]),
                seeds=tuple(run.seed for run in mine),
                **printed(task, arm, controller, "position"),
                first_mode_hz=frequency,
                damping_ratio=damping,
            )
        )
    return rows


def training_rows(experiment: str, trained: Sequence[TrainedNetworks], fidelity: str) -> list[Row]:
    """One row a network: held-out error [% of full range]."""
    arm, recipe = trained[0].arm, trained[0].recipe.name
    frequency, damping = first_mode(arm)
    rows = []
    for network in trained[0].percent:
        means, spreads = zip(*(networks.percent[network] for networks in trained), strict=True)
        rows.append(
            Row(
                experiment=experiment,
                task="training",
                arm=arm.name,
                fidelity=fidelity,
                controller=network,
                recipe=recipe,
                metric="held-out error",
                unit="%",
                mean=float(np.mean(means)),
                std_steps=float(np.mean(spreads)),
                std_seeds=float(np.std(means, ddof=1)) if len(means) > 1 else None,
                seeds=tuple(networks.seed for networks in trained),
                **printed("training", arm, network, "held-out error"),
                first_mode_hz=frequency,
                damping_ratio=damping,
            )
        )
    return rows
