"""A job: one strategy on one task with one seed, and the run that comes of it."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.data import CollectOptions
from s2c2a.episodes import Episode, load_episodes, save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Scored, rollout, score_run
from s2c2a.jobs.artifacts import Artifact, Cache, digest_of
from s2c2a.jobs.conditions import SIMULATED_FAST, Conditions
from s2c2a.jobs.trained import GivenNetworks, LSTMArtifact, NetworksArtifact, RecordingArtifact
from s2c2a.progress import Progress
from s2c2a.strategies import (
    AnyStrategy,
    LSTMStrategy,
    Recipe,
    pcc_fitted_strategy,
    pcc_strategy,
    s2c2a_strategy,
)
from s2c2a.tasks import Task, task_named
from s2c2a.versions import versions

START_JITTER = 0.05
"""Part of the full bend that every module is moved by before a run settles at rest: the start's own seed."""


@dataclass(frozen=True)
class Run:
    """What came of a job.

    Attributes:
        job: what was run.
        episode: what happened.
        scores: what its task is scored by.
    """

    job: "Job"
    episode: Episode
    scores: list[Scored]

    @property
    def task(self) -> str:
        """Its name."""
        return self.job.task.name

    @property
    def strategy(self) -> str:
        """Its name."""
        return self.job.strategy

    @property
    def seed(self) -> int:
        """Of data, training and start."""
        return self.job.seed


@dataclass(frozen=True)
class Job(Artifact[Run]):
    """A run to be made; finished ones are kept, and what is kept is what is scored.

    Attributes:
        task: what is asked, with axes weighed as the protocol does.
        arm: the arm that is driven.
        strategy: its name, one of `STRATEGIES`.
        recipe: how networks are trained and plans made.
        seed: of data, training and start.
        conditions: robot and guard.
        weights: networks for `s2c2a` in place of those that would be trained.

    Raises:
        S2C2AError: no such strategy.
    """

    kind, beside_runs = "runs", True
    task: Task
    arm: ArmSpec
    strategy: str
    recipe: Recipe
    seed: int = 0
    conditions: Conditions = SIMULATED_FAST
    weights: GivenNetworks | None = None

    def __post_init__(self):
        """Refuse a strategy that nobody knows."""
        if self.strategy not in STRATEGIES:
            raise S2C2AError(f"no strategy '{self.strategy}'; choose one of {', '.join(STRATEGIES)}")

    @cached_property
    def asked(self) -> Task:
        """The task with axes weighed as the recipe does."""
        return self.task.with_axes_weighed(self.recipe.axis_weight(self.task.name))

    @property
    def planner(self):
        """Options of the recipe's planner, with the guard of the conditions."""
        return replace(self.recipe.planner, guard=self.conditions.guard)

    @property
    def needs(self) -> tuple[Artifact, ...]:
        """What the strategy is made from."""
        return STRATEGIES[self.strategy].needs(self)

    @cached_property
    def file(self) -> str:
        """See `Artifact`; waypoints, too, can change under one name."""
        goals = hashlib.sha256()
        for goal in self.asked.goals:
            for part in goal:
                goals.update(np.ascontiguousarray(part).tobytes())
        rest = (self.strategy, self.recipe, self.seed, self.conditions, self.weights and self.weights.file)
        return f"{digest_of(self.task.name, goals.hexdigest(), arm_to_toml(self.arm), *rest)}{ENDING}"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        strategy = STRATEGIES[self.strategy].build(self, *(need.load(cache) for need in self.needs))
        watched = self.task.obstacles().size > 0
        robot = self.conditions.body.make(self.arm, seed=self.seed, jitter=START_JITTER, watched=watched)
        done = rollout(robot, strategy, self.asked, partial(progress, str(self)))
        made = {
            "strategy": self.strategy,
            "seed": self.seed,
            "recipe": self.recipe.name,
            "body": str(self.conditions.body),
        }
        save_episodes([done.with_options(**made, versions=versions())], self.path(cache))

    def load(self, cache: Cache) -> Run:
        """See `Artifact`."""
        episode = load_episodes(self.path(cache))[0][0]
        return Run(self, episode, score_run(episode, self.asked, self.recipe.name))

    def __str__(self) -> str:
        return f"{self.strategy} on {self.task.name} with {self.arm.name}, seed {self.seed}"


class StrategyKind(NamedTuple):
    """What a strategy is made from, and how.

    Attributes:
        needs: job -> artifacts.
        build: job and what these hold -> strategy.
    """

    needs: Callable[[Job], tuple[Artifact, ...]]
    build: Callable[..., AnyStrategy]


def _networks(job: Job, babbling: str = "staged") -> tuple[Artifact, ...]:
    return (job.weights or NetworksArtifact(job.arm, job.recipe, job.seed, babbling),)


def _with_networks(job: Job, networks: Any) -> AnyStrategy:
    return s2c2a_strategy(networks, job.conditions.guard)


STRATEGIES: dict[str, StrategyKind] = {
    "s2c2a": StrategyKind(_networks, _with_networks),
    "pcc": StrategyKind(lambda job: (), lambda job: pcc_strategy(job.arm, job.planner)),
    "pcc-fitted": StrategyKind(
        lambda job: (RecordingArtifact(job.arm, CollectOptions(seed=job.seed, speeds=job.recipe.speeds)),),
        lambda job, recording: pcc_fitted_strategy(recording, job.planner),
    ),
    "lstm": StrategyKind(lambda job: (LSTMArtifact(job.arm, job.seed),), lambda job, trained: LSTMStrategy(trained)),
    "s2c2a-motor": StrategyKind(
        lambda job: (NetworksArtifact(job.arm, job.recipe, job.seed, "motor"),), _with_networks
    ),
}
"""The paper's strategy, its comparisons, and the one trained on motor babbling (Chen et al. 2025, sec. IV)."""


def checked_seeds(first: int, count: int) -> range:
    """Seeds from the first one.

    Raises:
        S2C2AError: none, or a negative one.
    """
    if count < 1 or first < 0:
        raise S2C2AError(f"{count} seeds from {first} asked for; take at least one, from zero or above")
    return range(first, first + count)


def jobs_for(
    tasks: Sequence[str | Task],
    arm: ArmSpec,
    strategies: Sequence[str],
    seeds: Sequence[int],
    recipe: Recipe,
    conditions: Conditions = SIMULATED_FAST,
    weights: GivenNetworks | None = None,
) -> list[Job]:
    """A job for every seed, strategy and task, in this order; see `Job`.

    Raises:
        S2C2AError: no such task or strategy.
    """
    asked = [task if isinstance(task, Task) else task_named(task, arm) for task in dict.fromkeys(tasks)]
    return [
        Job(task, arm, strategy, recipe, seed, conditions, weights)
        for seed in seeds
        for strategy in dict.fromkeys(strategies)
        for task in asked
    ]
