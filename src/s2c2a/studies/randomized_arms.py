"""Arms that nobody modeled: drawn ones through data, training and tasks, for every strategy.

Whether any strategy runs away from targets that are held is tried, too. Recordings are
of the arm when it is young, runs of the same arm aged (docs/protocol.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from s2c2a import jobs
from s2c2a.arm import ArmSpec, randomized_arm
from s2c2a.errors import S2C2AError
from s2c2a.evaluation import Row, position_errors
from s2c2a.robots import Body
from s2c2a.spaces import POSITION
from s2c2a.strategies import RECIPES, recipe_named
from s2c2a.studies.tables import mean_rows
from s2c2a.studies.targets import Held, HeldTargets, ReachableTask
from s2c2a.tasks import Task, task_named
from s2c2a.tasks.registry import TILTS

EXPERIMENT = "randomised-arms"
TASKS = ("circle", *TILTS, "hold-middle")
STRATEGIES = {name: ("s2c2a", name) for name in RECIPES} | {
    name: (name, "best") for name in ("pcc", "pcc-fitted")
}
"""Name -> strategy and recipe; in the rows the name stands where a strategy's does."""
STRENGTHS = (0.5, 1.0)
FAITHFUL = 0.75  # strength from which targets are put within the true arm's reach
BEYOND = 20  # targets out of reach
RUNAWAY = 5.0  # cm
LAST = 1.0  # s of each target that must be still
AGED = jobs.Conditions(Body.simulation(aged=1.0))


@dataclass(frozen=True)
class Unknown:
    """What is tried.

    Attributes:
        base: modules, cables and all that controllers are told.
        arms: how many are drawn at each strength, with seeds from zero.
        strengths: of their mismatch.
        strategies: names of `STRATEGIES`.
        tasks: names.
        targets: within reach that are held, for runaways; none if zero.
        seed: of data, training and start.
    """

    base: ArmSpec
    arms: int = 10
    strengths: tuple[float, ...] = STRENGTHS
    strategies: tuple[str, ...] = ("best", "paper", "pcc", "pcc-fitted")
    tasks: tuple[str, ...] = TASKS
    targets: int = 200
    seed: int = 0

    def __post_init__(self):
        """Refuse what cannot be tried."""
        if unknown := set(self.strategies) - set(STRATEGIES):
            raise S2C2AError(
                f"no strategy '{min(unknown)}' here; choose among {', '.join(STRATEGIES)}"
            )
        if self.arms < 1 or self.targets < 0 or not self.strengths:
            raise S2C2AError(
                f"{self.arms} arms at {len(self.strengths)} strengths asked for; take at least one of each"
            )

    def drawn(self) -> list[tuple[float, ArmSpec]]:
        """Every strength with every arm."""
        return [
            (strength, randomized_arm(self.base, seed, strength))
            for strength in self.strengths
            for seed in range(self.arms)
        ]


@dataclass(frozen=True, eq=False)  # tasks hold arrays
class Trial:
    """One strategy on one arm.

    Attributes:
        strength: of the arm's mismatch.
        arm: the randomized arm.
        strategy: its name in `STRATEGIES`.
        tasks: of the protocol, within reach where that was searched.
        held: targets that are held.
    """

    strength: float
    arm: ArmSpec
    strategy: str
    tasks: tuple[Task, ...]
    held: tuple[Held, ...]

    def to_run(self, seed: int) -> list[jobs.Job]:
        """Its runs: the tasks, then what is held."""
        strategy, recipe = STRATEGIES[self.strategy]
        tasks = [*self.tasks, *(held.task for held in self.held)]
        return jobs.jobs_for(
            tasks, self.arm, [strategy], [seed], recipe_named(recipe), AGED
        )

    def rows(self, runs: Sequence[jobs.Run]) -> list[Row]:
        """Of these runs."""
        count = len(self.tasks)
        rows = jobs.score_rows(EXPERIMENT, runs[:count]) if count else []
        rows += mean_rows(rows)
        for run, held in zip(runs[count:], self.held, strict=True):
            rows += held_rows(run, held)
        return [
            replace(row, strategy=self.strategy, paper_mean=None, paper_std=None)
            for row in rows
        ]


def randomized_arms_rows(asked: Unknown, make: jobs.Make) -> list[Row]:
    """Rows of every arm, and of the mean and the worst over the arms of a strength.

    Args:
        asked: what is tried.
        make: finds or makes targets, runs, networks and recordings.
    """
    trials = _trials(asked, make)
    every = jobs.in_groups(make, [trial.to_run(asked.seed) for trial in trials])
    rows = {trial: trial.rows(runs) for trial, runs in zip(trials, every, strict=True)}
    summed = []
    for strength in asked.strengths:
        summed += over_arms(
            [rows[trial] for trial in trials if trial.strength == strength], strength
        )
    return summed + [row for ofarm in rows.values() for row in ofarm]


def held_rows(run: jobs.Run, held: Held) -> list[Row]:
    """How far the tip is from targets at the end of their time, and, out of reach, how still.

    Distances are beyond what the arm could do: out of reach the nearest it gets is
    taken off.
    """
    rate = run.job.arm.control_rate
    tips = run.episode.after("states")[:, -1, POSITION]
    ends = np.cumsum(np.full(len(held.distances), len(tips) // len(held.distances))) - 1
    far = (
        position_errors(run.episode.after("states"), run.job.task.desired_positions())[
            ends
        ]
        - 100 * held.distances
    )
    last = np.arange(-round(LAST * rate), 1)
    moved = 100 * np.ptp(tips[ends[:, None] + last], axis=1)
    values = {
        ("distance", "cm"): ([far.mean()], [far.std()]),
        ("distance, largest", "cm"): ([far.max()], []),
        ("runaways", "of targets"): ([(far > RUNAWAY).mean()], []),
        ("moved in the last second, largest", "cm"): (
            [np.linalg.norm(moved, axis=-1).max()],
            [],
        ),
    }
    heading = jobs.Heading.of(EXPERIMENT, [run])
    return [
        heading.row(
            run.task,
            run.strategy,
            metric,
            unit,
            *map(_floats, numbers),
            **heading.modes,
        )
        for (metric, unit), numbers in values.items()
    ]


def over_arms(rows: Sequence[Sequence[Row]], strength: float) -> list[Row]:
    """Means and the worst over arms, of every task, strategy and metric.

    Args:
        rows: of each trial at that strength.
        strength: of the arms' mismatch.
    """
    found: dict[tuple[str, str, str], list[Row]] = {}
    for row in chain.from_iterable(rows):
        found.setdefault((row.task, row.strategy, row.metric), []).append(row)
    summed = []
    for word, chosen in (("mean", np.mean), ("worst", np.max)):
        for alike in found.values():
            named = f"{word} of {len(alike)} arms at {strength:g}"
            told = replace(
                alike[0],
                arm=named,
                std_steps=None,
                first_mode_hz=None,
                damping_ratio=None,
            )
            summed.append(
                replace(told, mean=float(chosen([row.mean for row in alike])))
            )
    return summed


def _trials(asked: Unknown, make: jobs.Make) -> list[Trial]:
    """Every strategy on every arm, with what is asked of it."""
    drawn = asked.drawn()
    names = [asked.tasks if strength >= FAITHFUL else () for strength, _ in drawn]
    held = ((asked.targets, False), (BEYOND, True)) if asked.targets else ()
    sought: list[list[jobs.Artifact]] = [
        [
            *(ReachableTask(arm, name) for name in tasks),
            *(HeldTargets(arm, *one) for one in held),
        ]
        for tasks, (_, arm) in zip(names, drawn, strict=True)
    ]
    trials = []
    for (strength, arm), tasks, found in zip(
        drawn, names, jobs.in_groups(make, sought), strict=True
    ):
        ours = found[: len(tasks)] or [task_named(name, arm) for name in asked.tasks]
        given = tuple(ours), tuple(found[len(tasks) :])
        trials += [
            Trial(strength, arm, strategy, *given) for strategy in asked.strategies
        ]
    return trials


def _floats(values: Sequence) -> list[float]:
    return [float(value) for value in values]
