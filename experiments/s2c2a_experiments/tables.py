"""Tables of the paper, and the ablation table of the `best` recipe.

A table lists the arms, tasks and strategies whose runs it needs. The ablation runs
recipes without one ingredient of `best`, or with one added to `paper` (docs/concepts/recipe.md).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from s2c2a import jobs
from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import ArmError, S2C2AError, StrategyError, counted
from s2c2a.estimation import PAPER_COUPLING
from s2c2a.evaluation import Row
from s2c2a.jobs.run_folder import trace_of
from s2c2a.models import ChainOptions
from s2c2a.planning import Adam, Horizon
from s2c2a.planning.terms import Evenness
from s2c2a.robots import RobotFactory
from s2c2a.strategies import RECIPES, Recipe, RunOptions, strategy_named
from s2c2a.tasks.paths import PATHS
from s2c2a.tasks.registry import TILTS
from s2c2a.viz import recording_figure, run_figure
from s2c2a_experiments.run_rows import labeled, tick_rows
from s2c2a_experiments.workspace import sensing_rows

PAYLOAD = 0.05  # kg
SIBLINGS = ("twin_capstan", "twin_creep", "twin_both")
TRACKING = ("circle", *TILTS)
HOLDING = ("hold-base", "hold-middle", "hold-end")
AVOIDING = ("reach-0", "reach-1", "reach-2", "risk-a", "risk-b", "risk-c")
COMPARED = ("s2c2a", "pcc", "pcc-fitted")


@dataclass(frozen=True)
class Block:
    """Runs of one arm under one set of conditions.

    Attributes:
        arm: makes it.
        tasks: names.
        strategies: names.
        conditions: robot and guard.
        label: of these conditions, for the rows.
    """

    arm: Callable[[], ArmSpec]
    tasks: tuple[str, ...]
    strategies: tuple[str, ...] = ("s2c2a",)
    conditions: jobs.Conditions = jobs.Conditions()  # noqa: RUF009  # frozen
    label: str = ""

    def make_jobs(self, seeds: Sequence[int], recipe: Recipe) -> list[jobs.Job]:
        """The runs of the block, once a seed."""
        return jobs.jobs_for(
            self.tasks, self.arm(), self.strategies, seeds, recipe, self.conditions
        )

    def rows(self, table: str, runs: Sequence[jobs.Run]) -> list[Row]:
        """Scores, their means over tilt tasks, and the times of control steps."""
        experiment = f"{table}, {self.label}" if self.label else table
        scores = jobs.score_rows(experiment, runs)
        return scores + mean_rows(scores) + tick_rows(experiment, runs)


def sensing_coupled(arm: ArmSpec) -> ArmSpec:
    """The arm with encoder cables through all modules (Chen et al. 2025, eq. (11)).

    Raises:
        ArmError: the arm does not have three modules.
    """
    if arm.module_count != len(PAPER_COUPLING):
        raise ArmError(
            f"'{arm.name}' has {counted(arm.module_count, 'module')}; "
            f"the paper's sensing coupling needs {len(PAPER_COUPLING)}"
        )
    changes = {
        "name": f"{arm.name}_sensing_coupled",
        "sensing_coupling": PAPER_COUPLING,
    }
    return ArmSpec.model_validate(arm.model_dump() | changes)


def actuation_coupled(arm: ArmSpec) -> ArmSpec:
    """The arm with drive cables through all lower modules (Chen et al. 2025, fig. 9C).

    Tensions are halved: those of all modules add up at the base, which would otherwise
    bend three times as far.
    """
    description = arm.model_dump()
    description["name"] = f"{arm.name}_actuation_coupled"
    description["coupled_cables"] = True
    for module in description["modules"]:
        for tension in ("pretension", "tension_range"):
            if module.get(tension):
                module[tension] /= 2
    return ArmSpec.model_validate(description)


def _draw(runs: Sequence[jobs.Run], label: str, folder: Path) -> Iterator[Path]:
    """A figure of every task of one block, with all strategies."""
    arm = runs[0].job.arm
    for task in dict.fromkeys(run.task for run in runs):
        traces = [trace_of(run) for run in runs if run.task == task]
        name = "-".join([arm.name, task, *label.split()])
        title = ", ".join(filter(None, [task, arm.name, label]))
        yield run_figure(traces, arm, folder / f"figure-{name}.png", title)


def _networks(
    make: jobs.Make, seeds: Sequence[int], recipe: Recipe, folder: Path
) -> tuple[list[Row], list[Path]]:
    """Rows of held-out errors; no figure."""
    groups = [
        [jobs.NetworksArtifact.of_recipe(arm(), recipe, seed) for seed in seeds]
        for arm in (_TWIN, _SIMULATED)
    ]
    rows = []
    for trained in jobs.in_groups(make, groups):
        rows += jobs.training_rows("networks", trained)
    return rows, []


def _workspace(
    make: jobs.Make, seeds: Sequence[int], recipe: Recipe, folder: Path
) -> tuple[list[Row], list[Path]]:
    """Rows of workspace and sensing; a figure of the workspace."""
    rows, recording = sensing_rows(_TWIN(), seeds, make, recipe)
    arm = recording.arm
    states = recording.sensor("states").reshape(-1, arm.module_count, 6)
    return rows, [recording_figure(states, arm, folder / "figure-workspace.png")]


_TWIN = partial(load_arm, "twin_arm")
_SIMULATED = partial(load_arm, "simulated_arm")

TABLES: dict[str, tuple[Block, ...]] = {
    "simulation": (
        Block(
            _SIMULATED,
            ("circle",),
            ("s2c2a", "s2c2a-motor", "lstm", "pcc", "pcc-fitted"),
        ),
        Block(lambda: sensing_coupled(_SIMULATED()), ("circle",)),
        Block(lambda: actuation_coupled(_SIMULATED()), ("circle",)),
    ),
    "tracking": (
        Block(_TWIN, TRACKING, COMPARED),
        *(
            Block(partial(load_arm, name), TRACKING, label="other hysteresis")
            for name in SIBLINGS
        ),
        Block(
            _TWIN,
            ("circle",),
            COMPARED,
            jobs.Conditions(RobotFactory.simulation(payload=PAYLOAD)),
            "50 g at the tip",
        ),
    ),
    "constraint": (Block(_TWIN, HOLDING, COMPARED),),
    "obstacles": (
        Block(_TWIN, AVOIDING),
        Block(
            _TWIN,
            AVOIDING[1:],
            conditions=jobs.Conditions(run=RunOptions("arm")),
            label="whole arm guarded",
        ),
    ),
    "interaction": (Block(_TWIN, ("flee", "follow")),),
    "paths": (Block(_TWIN, tuple(PATHS), COMPARED),),
}
"""Name -> what is run (Chen et al. 2025, secs. III-B and IV)."""

OTHERS = {"networks": _networks, "workspace": _workspace}
"""Tables without runs (secs. II-D and III-B): name -> makes its rows and figures."""


def check_strategies(names: Sequence[str], strategies: Sequence[str]) -> None:
    """Check that further strategies support the options of all runs of tables.

    Args:
        names: of tables; those that compare no strategies are passed over.
        strategies: names of the strategies.

    Raises:
        S2C2AError: there is no such strategy, or it does not support an option.
    """
    for name, strategy in product(names, strategies):
        supports = strategy_named(strategy).supports
        for block in TABLES.get(name, ()):
            try:
                block.conditions.run.check_supported(supports, f"'{strategy}'")
            except StrategyError as error:
                raise S2C2AError(
                    f"--strategy {strategy} cannot be compared in table '{name}': "
                    f"{error}; here, reproduce other tables one by one"
                ) from error


def make_table(
    name: str,
    folder: Path,
    seeds: Sequence[int],
    make: jobs.Make,
    recipe: Recipe,
    strategies: Sequence[str] = (),
) -> tuple[list[Row], list[Path]]:
    """Make one table and draw its figures; `make` resumes an interrupted attempt.

    Args:
        name: of the table.
        folder: for figures.
        seeds: of data, training and start.
        make: loads or makes runs, networks and recordings.
        recipe: how networks are trained and plans made.
        strategies: names of further strategies to run in every block.

    Returns:
        Its rows, and the figures.

    Raises:
        S2C2AError: the table has no strategies to compare.
    """
    if name in OTHERS:
        if strategies:
            raise S2C2AError(
                f"table '{name}' compares no strategies; leave --strategy out, or "
                f"choose one of {', '.join(TABLES)}"
            )
        return OTHERS[name](make, seeds, recipe, folder)
    blocks = [
        replace(block, strategies=(*block.strategies, *strategies))
        for block in TABLES[name]
    ]
    results = jobs.in_groups(make, [block.make_jobs(seeds, recipe) for block in blocks])
    rows = []
    figures: list[Path] = []
    for block, runs in zip(blocks, results, strict=True):
        rows += block.rows(name, runs)
        first = [run for run in runs if run.seed == runs[0].seed]
        figures += _draw(first, block.label, folder)
    return rows, figures


def mean_rows(rows: Sequence[Row]) -> list[Row]:
    """Means over the tilt tasks of every strategy and metric, with the paper's."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.task in TILTS:
            groups.setdefault((row.strategy, row.metric), []).append(row)
    means = []
    for group in groups.values():
        changes: dict[str, Any] = {
            "task": f"mean of {len(group)} tilt tasks",
            "std_seeds": None,
        }
        for name in ("mean", "std_steps", "paper_mean", "paper_std"):
            values = [getattr(row, name) for row in group]
            changes[name] = None if None in values else sum(values) / len(values)
        means.append(replace(group[0], **changes))
    return means


ABLATION_TASKS = ("circle", "tilt-60", "tilt-0", *HOLDING)
"""The circle, tasks at the limits of bending, and tasks that hold a module end."""
_BEST = RECIPES["best"]
_PAPER = RECIPES["paper"]
_UNEVEN = tuple(term for term in _BEST.planner.terms if term != Evenness())

VARIANTS: dict[str, Recipe] = {
    "best": _BEST,
    "best, no memory at all": replace(
        _BEST, c2s=ChainOptions(play_widths=(), creep_times=())
    ),
    "best, no creep": replace(_BEST, c2s=ChainOptions(creep_times=())),
    "best, no statics of cables": replace(_BEST, c2s=ChainOptions(statics=False)),
    "best, no memory, no statics": replace(
        _BEST, c2s=ChainOptions(play_widths=(), creep_times=(), statics=False)
    ),
    "best, the paper's C2S": replace(_BEST, c2s=_PAPER.c2s, c2s_fit=_PAPER.c2s_fit),
    "best, the paper's planner": replace(_BEST, planner=_PAPER.planner),
    "best, true slopes": replace(
        _BEST, planner=replace(_BEST.planner, engaged_slopes=False)
    ),
    "best, no evenness": replace(_BEST, planner=replace(_BEST.planner, terms=_UNEVEN)),
    "best, 1 iteration": replace(
        _BEST, planner=replace(_BEST.planner, solver=Horizon(1))
    ),
    "best, 5 iterations": replace(
        _BEST, planner=replace(_BEST.planner, solver=Horizon(5))
    ),
    "best, no integral correction": replace(_BEST, integral_gain=0.0),
    "best, the paper's weights": replace(_BEST, axis_weights=()),
    "best, data as fast as the paper recipe's": replace(_BEST, speeds=_PAPER.speeds),
    "best, a network twice as wide": replace(_BEST, c2s=ChainOptions(hidden=128)),
    "paper": _PAPER,
    "paper, slower data": replace(_PAPER, speeds=_BEST.speeds),
    "paper, integral correction": replace(_PAPER, integral_gain=_BEST.integral_gain),
    "paper, 60 iterations": replace(
        _PAPER, planner=replace(_PAPER.planner, solver=Adam(iterations=60))
    ),
    "paper, the best planner": replace(_PAPER, planner=_BEST.planner),
}
"""Name, which result rows have as their strategy -> recipe."""


def ablation_rows(
    seeds: Sequence[int], make: jobs.Make, arm: str = "twin_arm"
) -> list[Row]:
    """Make rows of the ablation: six tasks with every variant, once a seed.

    Args:
        seeds: of data, training and start.
        make: loads or makes runs.
        arm: a preset or an arm file.
    """
    spec = load_arm(arm)
    groups = [
        jobs.jobs_for(ABLATION_TASKS, spec, ("s2c2a",), seeds, recipe)
        for recipe in VARIANTS.values()
    ]
    rows = []
    for name, runs in zip(VARIANTS, jobs.in_groups(make, groups), strict=True):
        rows += labeled(jobs.score_rows("ingredients", runs), name)
    return rows
