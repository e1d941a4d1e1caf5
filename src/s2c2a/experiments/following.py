"""Controllers on a task, over seeds: rollouts and their rows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.evaluation import Rollout, position_errors, rollout
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.experiments.paper import printed
from s2c2a.experiments.workshop import Progress, Workshop, quiet
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.strategies import Recipe, Strategy, TrainedNetworks
from s2c2a.tasks import task_named

MakeStrategy = Callable[[str, int], Strategy]


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
    """
    runs = []
    for seed in seeds:
        for controller in controllers:
            strategy = make_strategy(controller, seed)
            robot = SimulatedRobot(arm, fidelity, seed, payload)
            told = partial(progress, f"{controller} on {task} with {arm.name}, seed {seed}")
            done = rollout(robot, strategy, task_named(task, arm), told)
            runs.append(Run(controller, seed, done, position_errors(done.states, done.task.wanted_positions())))
    return runs


def workshop_strategies(workshop: Workshop, arm: ArmSpec, recipe: Recipe) -> MakeStrategy:
    """Strategies made or found by a workshop."""
    return lambda controller, seed: workshop.strategy(controller, arm, recipe, seed)


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
                **printed(task, arm.name, controller, "position"),
                first_mode_hz=frequency,
                damping_ratio=damping,
            )
        )
    return rows


def training_rows(experiment: str, trained: Sequence[TrainedNetworks], fidelity: str) -> list[Row]:
    """One row a network: held-out error [% of full range]."""
    arm, recipe = trained[0].arm, trained[0].recipe
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
                std_seeds=float(np.std(means)) if len(means) > 1 else None,
                seeds=tuple(networks.seed for networks in trained),
                **printed("training", arm.name, network, "held-out error"),
            )
        )
    return rows
