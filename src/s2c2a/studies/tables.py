"""The paper's tables and figures: which arms, tasks and strategies each is made of; and the table of ingredients.

What each ingredient of the `best` recipe is worth: left out of it, or alone beside the
paper's (docs/recipe.md).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from s2c2a import jobs
from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.evaluation import Row, tilts_deg
from s2c2a.jobs.run_folder import trace_of
from s2c2a.models import ChainOptions
from s2c2a.planning import Adam, LeastSquares
from s2c2a.planning.terms import Evenness
from s2c2a.robots import Body
from s2c2a.sensing import PAPER_COUPLING, estimator_for
from s2c2a.strategies import RECIPES, Recipe
from s2c2a.studies.calibration import sensing_rows
from s2c2a.studies.space_figures import obstacles_figure, plan_view_figure, poses_figure
from s2c2a.studies.time_figures import (
    coordinates_figure,
    estimation_figure,
    interaction_figure,
    orientation_figure,
)
from s2c2a.tasks.paths import PATHS
from s2c2a.tasks.registry import TILTS
from s2c2a.viz import Trace, recording_figure

PAYLOAD = 0.05  # kg
SIBLINGS = ("twin_capstan", "twin_creep", "twin_both")
TRACKING = ("circle", *TILTS)
HOLDING = ("hold-base", "hold-middle", "hold-end")
AVOIDING = ("reach-0", "reach-1", "reach-2", "risk-a", "risk-b", "risk-c")
COMPARED = ("s2c2a", "pcc", "pcc-fitted")

Drawn = Sequence[tuple[str, list[jobs.Run]]]
"""What is special about some runs, and these, of the first seed."""


@dataclass(frozen=True)
class Block:
    """Runs of one arm under one set of conditions.

    Attributes:
        arm: makes it.
        tasks: names.
        strategies: names.
        conditions: robot and guard.
        said: what is special about them, for the rows.
    """

    arm: Callable[[], ArmSpec]
    tasks: tuple[str, ...]
    strategies: tuple[str, ...] = ("s2c2a",)
    conditions: jobs.Conditions = jobs.SIMULATED_FAST
    said: str = ""

    def rows(self, table: str, runs: Sequence[jobs.Run]) -> list[Row]:
        """Scores, their means over tilt tasks, and the times of control steps."""
        experiment = f"{table}, {self.said}" if self.said else table
        own = jobs.score_rows(experiment, runs)
        # the paper loads its arm with nothing
        if "payload" in dict(self.conditions.body.options):
            own = [replace(row, paper_mean=None, paper_std=None) for row in own]
        return own + mean_rows(own) + jobs.tick_rows(experiment, runs)


@dataclass(frozen=True)
class Table:
    """What a table of runs is made of.

    Attributes:
        blocks: its runs.
        draw: figures of these into a folder.
    """

    blocks: tuple[Block, ...]
    draw: Callable[[Drawn, Path], list[Path]]


def sensing_coupled(arm: ArmSpec) -> ArmSpec:
    """Sensors that pass through the whole arm (Chen et al. 2025, eq. (11)).

    Raises:
        ArmError: not an arm of three modules.
    """
    if arm.module_count != len(PAPER_COUPLING):
        raise ArmError(
            f"the paper's sensing coupling is for three modules; '{arm.name}' has {arm.module_count}"
        )
    coupled = {
        "name": f"{arm.name}_sensing_coupled",
        "sensing_coupling": PAPER_COUPLING,
    }
    return ArmSpec.model_validate(arm.model_dump() | coupled)


def actuation_coupled(arm: ArmSpec) -> ArmSpec:
    """Cables that pass through all modules below their own (Chen et al. 2025, fig. 9C).

    Tensions are halved: those of all modules add up at the base, which would otherwise
    bend three times as far.
    """
    described = arm.model_dump() | {
        "name": f"{arm.name}_actuation_coupled",
        "coupled_cables": True,
    }
    for module in described["modules"]:
        for tension in ("pretension", "tension_range"):
            if module.get(tension):
                module[tension] = module[tension] / 2
    return ArmSpec.model_validate(described)


def _draw_simulation(drawn: Drawn, folder: Path) -> list[Path]:
    """Coordinates of every strategy, on the plain arm and on its variants."""
    every = [
        (run, run.job.arm.name.removeprefix("simulated_arm").replace("_", " "))
        for _, runs in drawn
        for run in runs
    ]
    traces = [
        trace_of(run, f"{run.strategy},{variant}" if variant else None)
        for run, variant in every
    ]
    return [coordinates_figure(traces, folder / "figure-sim2-coordinates.png")]


def _draw_tracking(drawn: Drawn, folder: Path) -> list[Path]:
    """The circle and the tilt tasks of the first runs."""
    circle = [trace_of(run) for run in drawn[0][1] if run.task == "circle"]
    ours = _by_task(drawn[0][1])
    views = {task: ours[task] for task in ("tilt-50", "tilt-50-a20", "tilt-50-c20")}
    return [
        coordinates_figure(circle, folder / "figure-06-coordinates.png"),
        orientation_figure([ours["tilt-50-a20"]], folder / "figure-08-orientation.png"),
        plan_view_figure(views, folder / "figure-10-plan-view.png"),
    ]


def _draw_constraint(drawn: Drawn, folder: Path) -> list[Path]:
    """Shapes of the arm while an end is held."""
    return [poses_figure(_by_task(drawn[0][1]), folder / "figure-11-poses.png")]


def _draw_interaction(drawn: Drawn, folder: Path) -> list[Path]:
    """An obstacle and a target that move."""
    both = _by_task(drawn[0][1])
    return [
        interaction_figure(
            both["flee"], both["follow"], folder / "figure-14-interaction.png"
        )
    ]


def _draw_obstacles(drawn: Drawn, folder: Path) -> list[Path]:
    """Ways past obstacles, with either guard."""
    guarded = [_by_task(runs, said or "tip guarded") for said, runs in drawn]
    ways = {
        task: [traces[task] for traces in guarded if task in traces]
        for task in AVOIDING
    }
    return [
        obstacles_figure(
            {task: ways[task] for task in AVOIDING[:3]},
            folder / "figure-12-obstacles.png",
        ),
        obstacles_figure(
            {task: ways[task] for task in AVOIDING[3:]}, folder / "figure-13-risk.png"
        ),
    ]


def _by_task(runs: Sequence[jobs.Run], label: str | None = None) -> dict[str, Trace]:
    """Ours, by task."""
    return {run.task: trace_of(run, label) for run in runs if run.strategy == "s2c2a"}


def _networks(
    make: jobs.Make, seeds: Sequence[int], recipe: Recipe, folder: Path
) -> tuple[list[Row], list[Path]]:
    every = [
        [jobs.NetworksArtifact(arm(), recipe, seed) for seed in seeds]
        for arm in (_TWIN, _SIMULATED)
    ]
    return [
        row
        for trained in jobs.in_groups(make, every)
        for row in jobs.training_rows("networks", trained)
    ], []


def _workspace(
    make: jobs.Make, seeds: Sequence[int], recipe: Recipe, folder: Path
) -> tuple[list[Row], list[Path]]:
    """Rows; workspace of the staged data, the middle module's bend as sensed and as it was in one episode."""
    rows, recording = sensing_rows(_TWIN(), seeds, make, recipe)
    arm = recording.arm
    true = recording.sensor("configurations")[-1]
    sensed = estimator_for(arm).sensed(recording.readings())[-1]
    bends, said = (
        tilts_deg(values[:, arm.module_count // 2]) for values in (true, sensed)
    )
    states = recording.sensor("states").reshape(-1, arm.module_count, 6)
    return rows, [
        recording_figure(states, arm, folder / "figure-03-workspace.png"),
        estimation_figure(
            recording.time[-1], bends, said, folder / "figure-04-estimation.png"
        ),
    ]


def _draw_paths(drawn: Drawn, folder: Path) -> list[Path]:
    """Each path from above."""
    return [
        plan_view_figure(_by_task(drawn[0][1]), folder / "figure-paths-plan-view.png")
    ]


_TWIN = partial(load_arm, "twin_arm")
_SIMULATED = partial(load_arm, "simulated_arm")

TABLES: dict[str, Table] = {
    "simulation": Table(
        (
            Block(
                _SIMULATED,
                ("circle",),
                ("s2c2a", "s2c2a-motor", "lstm", "pcc", "pcc-fitted"),
            ),
            Block(lambda: sensing_coupled(_SIMULATED()), ("circle",)),
            Block(lambda: actuation_coupled(_SIMULATED()), ("circle",)),
        ),
        _draw_simulation,
    ),
    "tracking": Table(
        (
            Block(_TWIN, TRACKING, COMPARED),
            *(
                Block(partial(load_arm, name), TRACKING, said="other hysteresis")
                for name in SIBLINGS
            ),
            Block(
                _TWIN,
                ("circle",),
                COMPARED,
                jobs.Conditions(Body.simulation(payload=PAYLOAD)),
                "50 g at the tip",
            ),
        ),
        _draw_tracking,
    ),
    "constraint": Table((Block(_TWIN, HOLDING, COMPARED),), _draw_constraint),
    "obstacles": Table(
        (
            Block(_TWIN, AVOIDING),
            Block(
                _TWIN,
                AVOIDING[1:],
                conditions=jobs.Conditions(guard="arm"),
                said="whole arm guarded",
            ),
        ),
        _draw_obstacles,
    ),
    "interaction": Table((Block(_TWIN, ("flee", "follow")),), _draw_interaction),
    "paths": Table((Block(_TWIN, tuple(PATHS), COMPARED),), _draw_paths),
}
"""Name -> what it is made of (Chen et al. 2025, secs. III-B and IV)."""

OTHERS = {"networks": _networks, "workspace": _workspace}
"""Tables of no runs (the same, secs. II-D and III-B): name -> what makes its rows and
figures."""


def make_table(
    name: str, folder: Path, seeds: Sequence[int], make: jobs.Make, recipe: Recipe
) -> tuple[list[Row], list[Path]]:
    """Make one table, from nothing or from where an earlier attempt was cut short, and draw its figures.

    Args:
        name: of the table.
        folder: for figures.
        seeds: of data, training and start.
        make: finds or makes runs, networks and recordings.
        recipe: how networks are trained and plans made.

    Returns:
        Its rows, and the figures.

    Raises:
        S2C2AError: no such table.
    """
    if name in OTHERS:
        return OTHERS[name](make, seeds, recipe, folder)
    if name not in TABLES:
        raise S2C2AError(
            f"no table '{name}'; choose one of {', '.join([*TABLES, *OTHERS])}, or all"
        )
    blocks = TABLES[name].blocks
    asked = [
        jobs.jobs_for(
            one.tasks, one.arm(), one.strategies, seeds, recipe, one.conditions
        )
        for one in blocks
    ]
    made = list(zip(blocks, jobs.in_groups(make, asked), strict=True))
    drawn = [
        (block.said, [run for run in runs if run.seed == runs[0].seed])
        for block, runs in made
    ]
    return [row for block, runs in made for row in block.rows(name, runs)], TABLES[
        name
    ].draw(drawn, folder)


def mean_rows(rows: Sequence[Row]) -> list[Row]:
    """Means over the six tilt tasks, of every strategy and metric, the paper's beside them."""
    means = []
    for strategy, metric in dict.fromkeys(
        (row.strategy, row.metric) for row in rows if row.task in TILTS
    ):
        mine = [
            row
            for row in rows
            if row.task in TILTS and (row.strategy, row.metric) == (strategy, metric)
        ]
        averaged: dict[str, Any] = {"std_seeds": None}
        for name in ("mean", "std_steps", "paper_mean", "paper_std"):
            values = [getattr(row, name) for row in mine]
            averaged[name] = None if None in values else sum(values) / len(values)
        means.append(
            replace(mine[0], task=f"mean of {len(mine)} tilt tasks", **averaged)
        )
    return means


INGREDIENT_TASKS = ("circle", "tilt-60", "tilt-0", *HOLDING)
"""The plain one, those at the edge of what bends can do, and those that hold an end."""
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
    "best, 5 iterations": replace(
        _BEST, planner=replace(_BEST.planner, solver=LeastSquares(5))
    ),
    "best, 60 iterations": replace(
        _BEST, planner=replace(_BEST.planner, solver=LeastSquares(60))
    ),
    "best, no integral correction": replace(_BEST, correction=0.0),
    "best, the paper's weights": replace(_BEST, axis_weights=()),
    "best, data as fast as the paper recipe's": replace(_BEST, speeds=_PAPER.speeds),
    "best, a network twice as wide": replace(_BEST, c2s=ChainOptions(hidden=128)),
    "paper": _PAPER,
    "paper, slower data": replace(_PAPER, speeds=_BEST.speeds),
    "paper, integral correction": replace(_PAPER, correction=_BEST.correction),
    "paper, 60 iterations": replace(
        _PAPER, planner=replace(_PAPER.planner, solver=Adam(iterations=60))
    ),
    "paper, least squares": replace(_PAPER, planner=_BEST.planner),
}
"""Name -> recipe; in the rows the name stands where a strategy's does."""


def ingredient_rows(
    seeds: Sequence[int], make: jobs.Make, arm: str = "twin_arm"
) -> list[Row]:
    """Six tasks with every variant, once a seed.

    Args:
        seeds: of data, training and start.
        make: finds or makes runs.
        arm: a preset or an arm file.
    """
    spec = load_arm(arm)
    every = jobs.in_groups(
        make,
        [
            jobs.jobs_for(INGREDIENT_TASKS, spec, ("s2c2a",), seeds, recipe)
            for recipe in VARIANTS.values()
        ],
    )
    return [
        replace(row, strategy=name, paper_mean=None, paper_std=None)
        for name, runs in zip(VARIANTS, every, strict=True)
        for row in jobs.score_rows("ingredients", runs)
    ]
