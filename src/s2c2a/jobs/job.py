"""A job: one strategy on one task with one seed, and the run that results."""

import hashlib
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from operator import attrgetter
from typing import Any

import numpy as np

from s2c2a import episodes, evaluation
from s2c2a.arm import ArmSpec
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.evaluation.rollout import OnStep, ignore_step
from s2c2a.execution import versions
from s2c2a.execution.progress import Progress
from s2c2a.files.text import MAX_SEED, is_seed
from s2c2a.goals import warn_of_ignored
from s2c2a.jobs.artifacts import Artifact, Cache, Networks, NetworksArtifact, digest_of
from s2c2a.robots import Robot, RobotFactory
from s2c2a.runtime import StepRecord
from s2c2a.runtime.border import named_errors
from s2c2a.runtime.step_writer import StepWriter
from s2c2a.strategies import (
    STRATEGIES,
    Recipe,
    RunOptions,
    StrategyOptions,
    shown_name,
    strategy_named,
)
from s2c2a.tasks import Task, load_task

COMPILING = "compiling the strategy"
START_JITTER = 0.05
"""Random bend of every module before a run, in parts of the full bend."""


@dataclass(frozen=True)
class Conditions:
    """What runs are made under.

    Attributes:
        robot: that is driven.
        run: options of the strategies.
        may_end_early: whether a run that an error ends is a result, too; its episode
            has the option `interrupted`.
    """

    robot: RobotFactory = RobotFactory.simulation()  # noqa: RUF009  # frozen
    run: RunOptions = RunOptions()  # noqa: RUF009  # frozen
    may_end_early: bool = False

    @property
    def fidelity(self) -> str:
        """Fidelity of the simulation; the robot's name if it is none."""
        return str(dict(self.robot.options).get("fidelity", self.robot.name))

    @property
    def has_payload(self) -> bool:
        """Whether a payload is known to hang at the arm."""
        options = dict(self.robot.options) if self.robot.simulated else {}
        return float(options.get("payload", 0)) + self.run.estimation.known_payload > 0


@dataclass(frozen=True)
class Run:
    """A finished job.

    Attributes:
        job: that was run.
        episode: its record; of a repeated task, that of the last repetition.
        scores: of its task; none if true states are missing.
        earlier: the repetitions before.
    """

    job: "Job"
    episode: episodes.Episode
    scores: list[evaluation.ScoreResult]
    earlier: tuple[episodes.Episode, ...] = ()

    task = property(attrgetter("job.task.name"), doc="Name of the task.")
    strategy = property(attrgetter("job.strategy"), doc="Name of the strategy.")
    seed = property(attrgetter("job.seed"), doc="Seed of data, training and start.")


@dataclass(frozen=True)
class Job(Artifact[Run]):
    """A run to be made. Finished ones are kept, and scored from what is kept.

    Attributes:
        task: with the axis weights of the protocol.
        arm: that is driven.
        strategy: see `strategy_named`.
        recipe: how networks are trained and plans made.
        seed: of data, training and start.
        conditions: robot and options of the run.
        weights: networks in place of trained ones, for the strategy that they belong to.
        repetitions: of the task; each learns from the one before (`tasks.repetition`).
        on_step: see `evaluation.rollout`; no part of the result, so that a finished run
            is not repeated for it.

    Raises:
        S2C2AError: no such strategy, it ignores an option of the run, or the number of
            repetitions is not valid.
    """

    kind = "runs"
    beside_runs = True
    task: Task
    arm: ArmSpec
    strategy: str
    recipe: Recipe
    seed: int = 0
    conditions: Conditions = Conditions()  # frozen
    weights: Networks | None = None
    repetitions: int = 1
    on_step: OnStep = field(default=ignore_step, compare=False, repr=False)

    def __post_init__(self):
        """Refuse unknown strategies, options that they ignore, and wrong numbers."""
        self.conditions.run.check_supported(
            self.options.supports, f"strategy '{self.strategy}'"
        )
        if self.repetitions < 1:
            raise S2C2AError(
                f"{self.repetitions} repetitions were given; give 1 or more"
            )

    @cached_property
    def options(self) -> StrategyOptions:
        """Options of the strategy; a user's own class is imported."""
        return strategy_named(self.strategy)

    @cached_property
    def weighted_task(self) -> Task:
        """The task with the axis weights of the recipe."""
        return self.task.with_scaled_axis_weights(
            self.recipe.axis_weight(self.task.name)
        )

    @property
    def needs(self) -> tuple[Artifact, ...]:
        """See `Artifact`: networks, if the strategy is trained."""
        name = STRATEGIES.name_of(type(self.options))
        if self.weights is not None and self.weights.are_of(name):
            return (self.weights,)
        with named_errors(
            StrategyError, f"strategy '{self.strategy}' cannot state what it needs"
        ):
            recipe = self.options.recipe(self.recipe)
            if self.options.collect_options(recipe, self.seed) is None:
                return ()
            arm = self.options.training_arm(self.arm, recipe)
        return (NetworksArtifact(arm, recipe, self.seed, self.options),)

    @cached_property
    def file(self) -> str:
        """See `Artifact`: waypoints may change under the same name."""
        content = hashlib.sha256()
        for goal in self.weighted_task.goals:
            for values in goal:
                content.update(np.ascontiguousarray(values).tobytes())
        digest = digest_of(
            self.task.name,
            self.task.foreseen,
            content.hexdigest(),
            self.arm,
            self.strategy,
            self.options,
            self.recipe,
            self.seed,
            self.conditions,
            self.weights and self.weights.file,
            self.repetitions,
        )
        return f"{digest}{ENDING}"

    def make(self, cache: Cache, progress: Progress) -> None:
        networks = [artifact.load(cache) for artifact in self.needs]
        trained = networks[0] if networks else None
        options = self.options
        if trained is not None and self.weights in self.needs:
            # a file's networks may have other options than the defaults
            options = type(options)(**trained.strategy_options)
        recipe = options.recipe(self.recipe)
        progress(COMPILING, 0, 1)
        with named_errors(StrategyError, f"strategy '{self.strategy}' cannot be built"):
            # `jobs_for` has said what it ignores, before any training
            strategy = options.build(self.arm, recipe, trained, self.conditions.run)

        def report(done: int, total: int) -> None:
            if done <= 1:
                progress(COMPILING, 1, 1)
            progress(str(self), done, total)

        robot = self.robot()
        interrupted = self.path(cache).with_name(f"interrupted-{self.file}")
        # repetitions of a real arm until an error; the result if the run may end early
        kept: list[episodes.Episode] = []

        def keep(episode: episodes.Episode) -> None:
            if not robot.own_time:
                episodes.save_episodes([*kept, episode], interrupted)
            if not robot.own_time or self.conditions.may_end_early:
                kept.append(episode)

        with self._steps_on_disk(robot, cache, kept) as keep_step:

            def on_step(step: StepRecord) -> None:
                keep_step(step)
                self.on_step(step)

            watched: dict[str, Any] = {"keep": keep, "on_step": on_step}
            parts = robot, strategy, self.weighted_task
            try:
                if self.repetitions == 1:
                    runs = [evaluation.rollout(*parts, report, **watched)]
                else:
                    runs = evaluation.repeated_rollout(
                        *parts, self.repetitions, report, **watched
                    )
            except S2C2AError as error:
                if not kept:  # the file may be that of an earlier run
                    raise
                if not self.conditions.may_end_early:
                    text = f"{error}; the steps until then are kept: {interrupted}"
                    raise S2C2AError(text) from error
                runs = kept
            described = [
                episode.with_options(
                    strategy=self.strategy,
                    seed=self.seed,
                    recipe=self.recipe.name,
                    robot=str(self.conditions.robot),
                    has_payload=self.conditions.has_payload,
                    versions=versions.versions(),
                )
                for episode in runs
            ]
            episodes.save_episodes(described, self.path(cache))

    @contextmanager
    def _steps_on_disk(
        self, robot: Robot, cache: Cache, kept: Sequence[episodes.Episode] = ()
    ) -> Iterator[OnStep]:
        """Write the steps of a real arm to files, a second after they were done.

        They are deleted at the end, where the result is saved, or what is `kept`. An
        error before that, or a killed process, leaves them. A warning says, while the arm
        moves, that the seen tip disagrees with its predictions.
        """
        if robot.own_time:
            yield ignore_step
            return
        path = self.path(cache).with_name(f"running-{self.file}")
        watch = evaluation.DisagreementWatch(self.arm)

        def warn_of_disagreement(steps: Sequence[StepRecord]) -> None:
            watch.add(steps)
            if watch.text and not self.conditions.has_payload:
                warnings.warn(watch.text, stacklevel=1)

        writer = StepWriter(path, self.arm, "run", watch=warn_of_disagreement)
        is_saved = False
        try:
            yield partial(writer.add, strategy=self.strategy, task=self.task.name)
            is_saved = True
        finally:
            writer.close()
            if is_saved or kept or not writer.count:
                for file in writer.files:
                    file.unlink(missing_ok=True)

    def robot(self) -> Robot:
        """The robot, not open yet.

        Raises:
            S2C2AError: it cannot be built.
        """
        has_line = self.task.obstacles().size > 0 or self.task.curve is not None
        return self.conditions.robot.make(
            self.arm, seed=self.seed, jitter=START_JITTER, center_line=has_line
        )

    def load(self, cache: Cache) -> Run:
        *earlier, episode = episodes.load_episodes(self.path(cache))[0]
        return Run(self, episode, self.score(episode), tuple(earlier))

    def score(self, episode: episodes.Episode) -> list[evaluation.ScoreResult]:
        """Scores of a whole episode of the task; none if true states are missing."""
        if "states" not in episode.sensors or "interrupted" in episode.options:
            return []
        return evaluation.score_run(episode, self.weighted_task, self.recipe.name)

    def __str__(self) -> str:
        return f"{self.strategy} on {self.task.name} with {self.arm.name}, seed {self.seed}"


def checked_seeds(first: int, count: int) -> range:
    """Seeds from the first one.

    Raises:
        S2C2AError: no seed, or one out of range.
    """
    if count < 1 or not is_seed(first) or not is_seed(first + count - 1):
        raise S2C2AError(
            f"seeds from {first} on, {count} in all, were given; give at least one, of "
            f"0 to {MAX_SEED}"
        )
    return range(first, first + count)


def jobs_for(
    tasks: Sequence[str | Task],
    arm: ArmSpec,
    strategies: Sequence[str],
    seeds: Sequence[int],
    recipe: Recipe,
    conditions: Conditions = Conditions(),
    weights: Networks | None = None,
    repetitions: int = 1,
) -> list[Job]:
    """A job for every seed, strategy and task, in this order; see `Job`.

    A warning says which parts of their goals a strategy ignores.

    Raises:
        S2C2AError: no such task or strategy, or scores that the task cannot have.
    """
    chosen = []
    for task in dict.fromkeys(tasks):
        chosen.append(task if isinstance(task, Task) else load_task(task, arm))
        evaluation.check_scores(chosen[-1], arm)
        for name in dict.fromkeys(strategies):
            ignored = chosen[-1].needs.intersection(strategy_named(name).ignores)
            warn_of_ignored(shown_name(name), ignored)
    return [
        Job(task, arm, strategy, recipe, seed, conditions, weights, repetitions)
        for seed, strategy, task in product(seeds, dict.fromkeys(strategies), chosen)
    ]
