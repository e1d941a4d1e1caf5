"""A job: one strategy on one task with one seed, and the run that comes of it."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from operator import attrgetter
from typing import Any

import numpy as np

from s2c2a import episodes, evaluation, strategies, versions
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError
from s2c2a.jobs.artifacts import (
    Artifact,
    Cache,
    LSTMArtifact,
    NetworksArtifact,
    digest_of,
)
from s2c2a.planning import Guard
from s2c2a.progress import Progress
from s2c2a.robots import Body, Robot
from s2c2a.strategies import AnyStrategy, Recipe
from s2c2a.tasks import Task, task_named

START_JITTER = 0.05
"""Part of the full bend that every module is moved by before a run settles at rest: the
start's own seed."""


@dataclass(frozen=True)
class Conditions:
    """What runs are made under.

    Attributes:
        body: what is driven.
        guard: what keeps out of obstacles.
        watched: what strategies that observe know of the arm.
    """

    body: Body = Body.simulation()
    guard: Guard = "tip"
    watched: strategies.Watched = strategies.Watched()

    @property
    def fidelity(self) -> str:
        """Of the simulation, for rows; the body's name where there is none."""
        return str(dict(self.body.options).get("fidelity", self.body.name))


SIMULATED_FAST = Conditions()


@dataclass(frozen=True)
class Run:
    """What came of a job.

    Attributes:
        job: what was run.
        episode: what happened.
        scores: what its task is scored by; none where nobody watched the arm.
    """

    job: "Job"
    episode: episodes.Episode
    scores: list[evaluation.Scored]

    task = property(attrgetter("job.task.name"), doc="Its name.")
    strategy = property(attrgetter("job.strategy"), doc="Its name.")
    seed = property(attrgetter("job.seed"), doc="Of data, training and start.")


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

    kind = "runs"
    beside_runs = True
    task: Task
    arm: ArmSpec
    strategy: str
    recipe: Recipe
    seed: int = 0
    conditions: Conditions = SIMULATED_FAST
    weights: Artifact[strategies.TrainedNetworks] | None = None

    def __post_init__(self):
        """Refuse a strategy that nobody knows."""
        if self.strategy not in STRATEGIES:
            raise S2C2AError(
                f"no strategy '{self.strategy}'; choose one of {', '.join(STRATEGIES)}"
            )

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
        return STRATEGIES[self.strategy][0](self)

    @cached_property
    def file(self) -> str:
        """See `Artifact`; waypoints, too, can change under one name."""
        parts = (
            np.ascontiguousarray(part).tobytes()
            for goal in self.asked.goals
            for part in goal
        )
        asked = (
            self.task.name,
            hashlib.sha256(b"".join(parts)).hexdigest(),
            arm_to_toml(self.arm),
        )
        rest = (
            self.strategy,
            self.recipe,
            self.seed,
            self.conditions,
            self.weights and self.weights.file,
        )
        return f"{digest_of(*asked, *rest)}{ENDING}"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        strategy = STRATEGIES[self.strategy][1](
            self, *(need.load(cache) for need in self.needs)
        )
        done = evaluation.rollout(
            self.robot(), strategy, self.asked, partial(progress, str(self))
        )
        body = str(self.conditions.body)
        made = {
            "strategy": self.strategy,
            "seed": self.seed,
            "recipe": self.recipe.name,
            "body": body,
        }
        episodes.save_episodes(
            [done.with_options(**made, versions=versions.versions())], self.path(cache)
        )

    def robot(self) -> Robot:
        """The body, not open yet.

        Raises:
            S2C2AError: it cannot be.
        """
        watched = self.task.obstacles().size > 0
        return self.conditions.body.make(
            self.arm, seed=self.seed, jitter=START_JITTER, watched=watched
        )

    def load(self, cache: Cache) -> Run:
        """See `Artifact`; what nobody watched has no scores."""
        episode = episodes.load_episodes(self.path(cache))[0][0]
        watched = "states" in episode.sensors
        return Run(
            self,
            episode,
            evaluation.score_run(episode, self.asked, self.recipe.name)
            if watched
            else [],
        )

    def __str__(self) -> str:
        return f"{self.strategy} on {self.task.name} with {self.arm.name}, seed {self.seed}"


def _networks(job: Job) -> tuple[Artifact, ...]:
    return (
        job.weights
        or NetworksArtifact(job.recipe.learned_on(job.arm), job.recipe, job.seed),
    )


def _motor_networks(job: Job) -> tuple[Artifact, ...]:
    return (
        NetworksArtifact(
            job.recipe.learned_on(job.arm),
            replace(job.recipe, babbling="motor"),
            job.seed,
        ),
    )


def _with_networks(job: Job, networks: Any) -> AnyStrategy:
    under = job.conditions
    return strategies.s2c2a_strategy(
        replace(networks, arm=job.arm), under.guard, under.watched
    )


def _recording(job: Job) -> tuple[Artifact, ...]:
    return NetworksArtifact(job.arm, job.recipe, job.seed).needs


# The paper's, its comparisons, and the one trained on motor babbling (Chen et al. 2025,
# sec. IV).
STRATEGIES: dict[
    str, tuple[Callable[[Job], tuple[Artifact, ...]], Callable[..., AnyStrategy]]
] = {
    "s2c2a": (_networks, _with_networks),
    "pcc": (lambda job: (), lambda job: strategies.pcc_strategy(job.arm, job.planner)),
    "pcc-fitted": (
        _recording,
        lambda job, data: strategies.pcc_fitted_strategy(data, job.planner),
    ),
    "lstm": (
        lambda job: (LSTMArtifact(job.arm, job.seed),),
        lambda job, trained: strategies.LSTMStrategy(trained),
    ),
    "s2c2a-motor": (_motor_networks, _with_networks),
}
"""Name -> what a job's is made from, and how: job -> artifacts; job and what these hold
-> strategy."""


def checked_seeds(first: int, count: int) -> range:
    """Seeds from the first one.

    Raises:
        S2C2AError: none, or a negative one.
    """
    if count < 1 or first < 0:
        raise S2C2AError(
            f"{count} seeds from {first} asked for; take at least one, from zero or above"
        )
    return range(first, first + count)


def jobs_for(
    tasks: Sequence[str | Task],
    arm: ArmSpec,
    strategies: Sequence[str],
    seeds: Sequence[int],
    recipe: Recipe,
    conditions: Conditions = SIMULATED_FAST,
    weights: Artifact[strategies.TrainedNetworks] | None = None,
) -> list[Job]:
    """A job for every seed, strategy and task, in this order; see `Job`.

    Raises:
        S2C2AError: no such task or strategy, or a task whose scores cannot be.
    """
    asked = [
        task if isinstance(task, Task) else task_named(task, arm)
        for task in dict.fromkeys(tasks)
    ]
    for task in asked:
        evaluation.check_scores(task, arm)
    every = product(seeds, dict.fromkeys(strategies), asked)
    return [
        Job(task, arm, strategy, recipe, seed, conditions, weights)
        for seed, strategy, task in every
    ]
