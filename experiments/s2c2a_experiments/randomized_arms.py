"""All strategies on arms with random model mismatch: data, training and tasks.

Also tests whether a strategy diverges from random targets that are held. Recordings
come from the new arm, runs from the same arm aged (docs/results/protocol.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec, randomized_arm
from s2c2a.evaluation import Row
from s2c2a.robots import RobotFactory
from s2c2a.spaces import POSITION
from s2c2a.strategies import Recipe, recipe_named
from s2c2a.tasks import Task, load_task
from s2c2a.tasks.registry import TILTS
from s2c2a_experiments.run_rows import errors_of, labeled, prediction_rows
from s2c2a_experiments.tables import mean_rows
from s2c2a_experiments.targets import RandomTargets, ReachableTask, TargetSequence

EXPERIMENT = "randomised-arms"
TASKS = ("circle", *TILTS, "hold-middle")
BASELINES = "pcc", "pcc-fitted"
"""Strategies other than the paper's; they are trained as the recipe `best` says."""
REACHABLE_FROM = 0.75  # mismatch strength from which goals are moved within reach
UNREACHABLE_COUNT = 20  # targets out of reach
RUNAWAY = 5.0  # cm; a larger error at the end of a target counts as a runaway
HIGHER_IS_BETTER = ("errors within twice the std",)  # metrics
STILL_TIME = 1.0  # s at the end of each target in which the tip should not move
AGED = jobs.Conditions(RobotFactory.simulation(aged=1.0))


@dataclass(frozen=True)
class RandomizedArmsStudy:
    """Arms, strategies and tasks of the study.

    Attributes:
        base: modules, cables and all that controllers know.
        arms: number of arms, with seeds from zero.
        strength: of the model mismatch.
        strategies: of `BASELINES`, or recipes of the paper's strategy.
        tasks: names.
        targets: number of random targets within reach; 0 for no targets at all.
        seed: of data, training and start.
    """

    base: ArmSpec
    arms: int = 10
    strength: float = 0.5
    strategies: tuple[str, ...] = ("best", "paper", "pcc", "pcc-fitted")
    tasks: tuple[str, ...] = TASKS
    targets: int = 20
    seed: int = 0

    def randomized(self) -> list[ArmSpec]:
        """The arms."""
        return [
            randomized_arm(self.base, seed, self.strength) for seed in range(self.arms)
        ]


@dataclass(frozen=True, eq=False)  # tasks hold arrays
class ArmTrial:
    """One strategy on one arm.

    Attributes:
        arm: the randomized arm.
        strategy: of `BASELINES`, or a recipe.
        tasks: of the protocol.
        targets: random targets that are held.
    """

    arm: ArmSpec
    strategy: str
    tasks: tuple[Task, ...]
    targets: tuple[TargetSequence, ...]

    def make_jobs(self, seed: int) -> list[jobs.Job]:
        """Runs of the tasks, then of the targets."""
        strategy, recipe = _strategy_and_recipe(self.strategy)
        tasks = [*self.tasks, *(targets.task for targets in self.targets)]
        return jobs.jobs_for(tasks, self.arm, [strategy], [seed], recipe, AGED)

    def rows(self, runs: Sequence[jobs.Run]) -> list[Row]:
        """Rows of the runs of `make_jobs`, in their order."""
        count = len(self.tasks)
        rows = jobs.score_rows(EXPERIMENT, runs[:count]) if count else []
        rows += mean_rows(rows)
        rows += prediction_rows(EXPERIMENT, runs[:count]) if count else []
        for run, targets in zip(runs[count:], self.targets, strict=True):
            rows += target_rows(run, targets)
        return labeled(rows, self.strategy)


def _strategy_and_recipe(name: str) -> tuple[str, Recipe]:
    """Strategy and recipe of a column of the results."""
    if name in BASELINES:
        return name, recipe_named("best")
    return "s2c2a", recipe_named(name)


def randomized_arms_rows(study: RandomizedArmsStudy, make: jobs.Make) -> list[Row]:
    """Make rows of every arm, and of the mean and the worst over arms.

    Args:
        study: arms, strategies and tasks.
        make: loads or makes targets, runs, networks and recordings.
    """
    trials = _trials(study, make)
    runs = jobs.in_groups(make, [trial.make_jobs(study.seed) for trial in trials])
    rows = [trial.rows(group) for trial, group in zip(trials, runs, strict=True)]
    return [*over_arms(rows, study.strength), *chain.from_iterable(rows)]


def target_rows(run: jobs.Run, targets: TargetSequence) -> list[Row]:
    """Rows of the tip's distance from held targets, and of its motion at the end.

    Distances count from the arm's nearest possible position: for targets out of reach,
    the smallest possible distance is subtracted.

    Args:
        run: of the targets' task.
        targets: in the order in which they are held.
    """
    count = len(targets.distances)
    tips = run.episode.after("states")[:, -1, POSITION]
    steps = len(tips) // count
    ends = np.arange(1, count + 1) * steps - 1
    excess = errors_of(run)[ends] - 100 * targets.distances  # cm
    still_steps = np.arange(-round(STILL_TIME * run.job.arm.control_rate), 1)
    held = tips[ends[:, None] + still_steps]
    extents = 100 * np.ptp(held, axis=1)
    motion = np.linalg.norm(extents, axis=-1)
    heading = jobs.Heading.of(EXPERIMENT, [run])
    rows = []

    def add(metric: str, unit: str, value: float, spreads: Sequence[float] = ()):
        values = [float(value)]
        names = (run.task, run.strategy, metric, unit)
        rows.append(heading.row(*names, values, spreads, **heading.modes))

    add("distance", "cm", excess.mean(), [float(excess.std())])
    add("distance, largest", "cm", excess.max())
    add("runaways", "of targets", (excess > RUNAWAY).mean())
    add("moved in the last second, largest", "cm", motion.max())
    return rows


def over_arms(rows: Sequence[Sequence[Row]], strength: float) -> list[Row]:
    """Means and the worst over arms, of every task, strategy and metric.

    Args:
        rows: of each trial at that strength.
        strength: of the arms' mismatch.
    """
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in chain.from_iterable(rows):
        groups.setdefault((row.task, row.strategy, row.metric), []).append(row)
    summary = []
    for word in ("mean", "worst"):
        for (_task, _strategy, metric), group in groups.items():
            values = [row.mean for row in group]
            worst = min if metric in HIGHER_IS_BETTER else max
            reduce = np.mean if word == "mean" else worst
            row = replace(
                group[0],
                arm=f"{word} of {len(group)} arms at {strength:g}",
                mean=float(reduce(values)),
                std_steps=None,
                first_mode_hz=None,
                damping_ratio=None,
            )
            summary.append(row)
    return summary


def _trials(study: RandomizedArmsStudy, make: jobs.Make) -> list[ArmTrial]:
    """Every strategy on every arm, with the tasks and targets of the arm."""
    arms = study.randomized()
    groups = [_target_artifacts(study, arm) for arm in arms]
    count = len(study.tasks) if study.strength >= REACHABLE_FROM else 0
    trials = []
    for arm, results in zip(arms, jobs.in_groups(make, groups), strict=True):
        tasks = results[:count] or [load_task(name, arm) for name in study.tasks]
        targets = tuple(results[count:])
        for strategy in study.strategies:
            trials.append(ArmTrial(arm, strategy, tuple(tasks), targets))
    return trials


def _target_artifacts(study: RandomizedArmsStudy, arm: ArmSpec) -> list[jobs.Artifact]:
    """Tasks that are moved within reach, then targets within and out of reach."""
    artifacts: list[jobs.Artifact] = []
    if study.strength >= REACHABLE_FROM:
        artifacts += [ReachableTask(arm, name) for name in study.tasks]
    if study.targets:
        artifacts.append(RandomTargets(arm, study.targets))
        artifacts.append(
            RandomTargets(arm, UNREACHABLE_COUNT, unreachable_waypoints=True)
        )
    return artifacts
