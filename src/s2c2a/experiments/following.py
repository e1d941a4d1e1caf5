"""Controllers on tasks, over seeds: rollouts and their rows."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

import s2c2a
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Rollout, Scored, rollout, score_run
from s2c2a.evaluation.report import Row, over_seeds
from s2c2a.evaluation.rollout_files import load_rollout, save_rollout
from s2c2a.experiments.paper import printed
from s2c2a.experiments.workshop import REVISION, Progress, Workshop, quiet
from s2c2a.planning.options import Guard
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.robots.simulation.modes import first_mode
from s2c2a.strategies import AnyStrategy, Recipe, TrainedNetworks, s2c2a_strategy
from s2c2a.tasks import Task, task_named

MakeStrategy = Callable[[str, int], AnyStrategy]

START_JITTER = 0.05
"""Part of the full bend that every module is moved by before a run settles at rest: the start's own seed."""


@dataclass(frozen=True)
class Run:
    """One controller's run on one task with one seed.

    Attributes:
        controller: its name.
        seed: of data, training and start.
        rollout: what happened.
        scores: what its task is scored by.
    """

    controller: str
    seed: int
    rollout: Rollout
    scores: list[Scored]

    @property
    def task(self) -> str:
        """Its name."""
        return self.rollout.task.name


@dataclass(frozen=True)
class Conditions:
    """What runs are made under.

    Attributes:
        fidelity: of the simulation that is driven.
        payload: at the tip [kg].
        guard: what keeps out of obstacles.
    """

    fidelity: str = "fast"
    payload: float = 0.0
    guard: Guard = "tip"


@dataclass(frozen=True)
class Shelf:
    """A folder of finished runs, so that a long table can be cut short and gone on with.

    Attributes:
        folder: where; nowhere if None.
        made_by: what else the runs depend on, such as the recipe.
    """

    folder: Path | None = None
    made_by: dict = field(default_factory=dict)

    def place(self, *parts) -> Path | None:
        """The file of a run; another where anything that it depends on differs."""
        if self.folder is None:
            return None
        text = json.dumps([parts, self.made_by, s2c2a.__version__, REVISION], sort_keys=True, default=str)
        return self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.npz"

    def place_of(self, arm: ArmSpec, controller: str, seed: int, task: Task, under: Conditions) -> Path | None:
        """The file of one controller's run on one task with one seed."""
        return self.place(arm_to_toml(arm), controller, seed, _asked(task), asdict(under))


def checked_seeds(first: int, count: int) -> range:
    """Seeds from the first one.

    Raises:
        S2C2AError: none, or a negative one.
    """
    if count < 1 or first < 0:
        raise S2C2AError(f"{count} seeds from {first} asked for; take at least one, from zero or above")
    return range(first, first + count)


def asked_of(tasks: Sequence[str | Task], arm: ArmSpec, recipe: Recipe) -> list[Task]:
    """Tasks, some by name, with axes weighed as the recipe does.

    Raises:
        S2C2AError: no such task.
    """
    named = [task if isinstance(task, Task) else task_named(task, arm) for task in dict.fromkeys(tasks)]
    return [task.with_axes_weighed(recipe.axis_weight(task.name)) for task in named]


def follow(
    tasks: Sequence[str | Task],
    arm: ArmSpec,
    controllers: Sequence[str],
    seeds: Sequence[int],
    make_strategy: MakeStrategy,
    recipe: Recipe,
    conditions: Conditions | None = None,
    shelf: Shelf | None = None,
    progress: Progress = quiet,
) -> list[Run]:
    """Let every controller work on every task, once a seed.

    Args:
        tasks: some by name.
        arm: the arm to simulate.
        controllers: names.
        seeds: of data, training and start.
        make_strategy: a strategy for (controller, seed); asked for once each, and only where a run is missing.
        recipe: scored by what the protocol allows it.
        conditions: simulation, payload, guard.
        shelf: where finished runs are kept.
        progress: told of every step.

    Raises:
        S2C2AError: no such task, impossible payload; before anything is trained.
    """
    under, shelf = conditions or Conditions(), shelf or Shelf()
    asked = asked_of(tasks, arm, recipe)
    SimulatedRobot(arm, under.fidelity, payload=under.payload)
    runs = []
    for seed in seeds:
        for controller in dict.fromkeys(controllers):
            strategy: AnyStrategy | None = None
            for task in asked:
                place = shelf.place_of(arm, controller, seed, task, under)
                done = load_rollout(place, task) if place else None
                if done is None:
                    strategy = strategy or make_strategy(controller, seed)
                    watched = task.obstacles().size > 0
                    robot = SimulatedRobot(arm, under.fidelity, seed, under.payload, START_JITTER, watched)
                    told = partial(progress, f"{controller} on {task.name} with {arm.name}, seed {seed}")
                    done = rollout(robot, strategy, task, told)
                    if place:  # what is kept is what is scored: a table that was cut short is the same
                        save_rollout(done, place)
                        done = load_rollout(place, task) or done
                runs.append(Run(controller, seed, done, score_run(done, recipe.name)))
    return runs


def workshop_strategies(
    workshop: Workshop, arm: ArmSpec, recipe: Recipe, saved: TrainedNetworks | None = None, guard: Guard = "tip"
) -> MakeStrategy:
    """Strategies made or found by a workshop; for `s2c2a` the saved networks, if there are any."""

    def make(controller: str, seed: int) -> AnyStrategy:
        if saved is not None and controller == "s2c2a":
            return s2c2a_strategy(saved, guard)
        return workshop.strategy(controller, arm, recipe, seed, guard)

    return make


def score_rows(experiment: str, arm: ArmSpec, runs: Sequence[Run], recipe: str, fidelity: str) -> list[Row]:
    """One row for every task, controller and metric, with the arm's first mode beside it."""
    frequency, damping = first_mode(arm)
    rows = []
    for task, controller in dict.fromkeys((run.task, run.controller) for run in runs):
        mine = [run for run in runs if (run.task, run.controller) == (task, controller)]
        for number, scored in enumerate(mine[0].scores):
            each = [run.scores[number] for run in mine]
            spreads = [_spread(one.values) for one in each] if scored.averaged else []
            rows.append(
                Row(
                    experiment=experiment,
                    task=task,
                    arm=arm.name,
                    fidelity=fidelity,
                    controller=controller,
                    recipe=recipe,
                    metric=scored.score.metric,
                    unit=scored.unit,
                    **over_seeds([one.value for one in each], spreads),
                    seeds=tuple(run.seed for run in mine),
                    **printed(task, arm, controller, scored.score.metric),
                    first_mode_hz=frequency,
                    damping_ratio=damping,
                )
            )
    return rows


def _asked(task: Task) -> str:
    """A task's name and what it asks for: waypoints can change under one name."""
    digest = hashlib.sha256()
    for goal in task.goals:
        for part in goal:
            digest.update(np.ascontiguousarray(part).tobytes())
    return f"{task.name}-{digest.hexdigest()[:16]}"


def _spread(values: Float[np.ndarray, " steps"]) -> float:
    """Over the steps that count; NaN where none does."""
    counted = values[np.isfinite(values)]
    return float(counted.std()) if len(counted) else float("nan")


def tick_rows(experiment: str, arm: ArmSpec, runs: Sequence[Run], recipe: str, fidelity: str) -> list[Row]:
    """Two rows a controller: median and 99th percentile of its control steps [ms], over all its runs."""
    rows = []
    for controller in dict.fromkeys(run.controller for run in runs):
        mine = [run for run in runs if run.controller == controller]
        seeds = tuple(dict.fromkeys(run.seed for run in mine))
        ticks = np.concatenate([1e3 * run.rollout.tick_times for run in mine])
        for metric, share in (("tick, median", 50), ("tick, 99th percentile", 99)):
            value = float(np.percentile(ticks, share))
            rows.append(
                Row(experiment, "all", arm.name, fidelity, controller, recipe, metric, "ms", value, seeds=seeds)
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
                **over_seeds(means, spreads),
                seeds=tuple(networks.seed for networks in trained),
                **printed("training", arm, network, "held-out error"),
                first_mode_hz=frequency,
                damping_ratio=damping,
            )
        )
    return rows
