"""The paper's tables and figures: which arms, tasks and controllers each is made of, and how it is made."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import S2C2AError
from s2c2a.evaluation.report import Row
from s2c2a.experiments.ahead import Job, jobs_for, make_all_ahead, shelf_for
from s2c2a.experiments.following import (
    Conditions,
    Run,
    follow,
    score_rows,
    tick_rows,
    training_rows,
    workshop_strategies,
)
from s2c2a.experiments.sensing_quality import EXTENTS, sensing_rows
from s2c2a.experiments.table_figures import draw_table
from s2c2a.experiments.variants import actuation_coupled, sensing_coupled
from s2c2a.experiments.workshop import Need, Workshop
from s2c2a.shards import Crew
from s2c2a.strategies import Recipe
from s2c2a.tasks.registry import TILTS

PAYLOAD = 0.05  # kg
SIBLINGS = ("twin_capstan", "twin_creep", "twin_both")
TRACKING = ("circle", *TILTS)
HOLDING = ("hold-base", "hold-middle", "hold-end")
AVOIDING = ("reach-0", "reach-1", "reach-2", "risk-a", "risk-b", "risk-c")


@dataclass(frozen=True)
class Part:
    """Runs of one arm under one set of conditions.

    Attributes:
        arm: makes it.
        tasks: names.
        controllers: names.
        conditions: simulation, payload, guard.
        said: what is special about them, for the rows.
    """

    arm: Callable[[], ArmSpec]
    tasks: tuple[str, ...]
    controllers: tuple[str, ...]
    conditions: Conditions = field(default_factory=Conditions)
    said: str = ""


def _preset(name: str) -> Callable[[], ArmSpec]:
    return lambda: load_arm(name)


_TWIN, _SIMULATED = _preset("twin_arm"), _preset("simulated_arm")

TABLES: dict[str, tuple[Part, ...]] = {
    "simulation": (
        Part(_SIMULATED, ("circle",), ("s2c2a", "s2c2a-motor", "lstm", "pcc", "pcc-fitted")),
        Part(lambda: sensing_coupled(_SIMULATED()), ("circle",), ("s2c2a",)),
        Part(lambda: actuation_coupled(_SIMULATED()), ("circle",), ("s2c2a",)),
    ),
    "tracking": (
        Part(_TWIN, TRACKING, ("s2c2a", "pcc", "pcc-fitted")),
        *(Part(_preset(name), TRACKING, ("s2c2a",), said="other hysteresis") for name in SIBLINGS),
        Part(_TWIN, ("circle",), ("s2c2a", "pcc", "pcc-fitted"), Conditions(payload=PAYLOAD), "50 g at the tip"),
    ),
    "constraint": (Part(_TWIN, HOLDING, ("s2c2a", "pcc", "pcc-fitted")),),
    "obstacles": (
        Part(_TWIN, AVOIDING, ("s2c2a",)),
        Part(_TWIN, AVOIDING[1:], ("s2c2a",), Conditions(guard="arm"), "whole arm guarded"),
    ),
    "interaction": (Part(_TWIN, ("flee", "follow"), ("s2c2a",)),),
    "networks": (),
    "workspace": (),
}
"""Name -> what it is made of (Chen et al. 2025, secs. II-D, III-B and IV)."""


def make_table(
    name: str, folder: Path, seeds: Sequence[int], workshop: Workshop, recipe: Recipe, crew: Crew | None = None
) -> tuple[list[Row], list[Path]]:
    """Make one table, from nothing or from where an earlier attempt was cut short, and draw its figures.

    Args:
        name: of the table.
        folder: for finished runs and figures.
        seeds: of data, training and start.
        workshop: where data and networks come from.
        recipe: how networks are trained and plans made.
        crew: who trains and runs; this process if None.

    Returns:
        Its rows, and the figures.

    Raises:
        S2C2AError: no such table.
    """
    if name not in TABLES:
        raise S2C2AError(f"no table '{name}'; choose one of {', '.join(TABLES)}, or all")
    if crew is not None:
        jobs = [job for part in TABLES[name] for job in _jobs(part, seeds, recipe)]
        make_all_ahead(jobs, folder / "runs", workshop, crew, _other_needs(name, seeds, recipe))
    shelf = shelf_for(recipe, folder / "runs")
    rows: list[Row] = []
    every: list[tuple[Part, ArmSpec, list[Run]]] = []
    for part in TABLES[name]:
        arm = part.arm()
        strategies = workshop_strategies(workshop, arm, recipe, guard=part.conditions.guard)
        runs = follow(
            part.tasks, arm, part.controllers, seeds, strategies, recipe, part.conditions, shelf, workshop.progress
        )
        experiment = f"{name}, {part.said}" if part.said else name
        own = score_rows(experiment, arm, runs, recipe.name, part.conditions.fidelity)
        if part.conditions.payload:  # the paper loads its arm with nothing
            own = [replace(row, paper_mean=None, paper_std=None) for row in own]
        rows += own + mean_rows(own) + tick_rows(experiment, arm, runs, recipe.name, part.conditions.fidelity)
        every.append((part, arm, runs))
    if name == "networks":
        for arm in (_TWIN(), _SIMULATED()):
            rows += training_rows(name, [workshop.networks(arm, recipe, seed) for seed in seeds], workshop.fidelity)
    if name == "workspace":
        rows += sensing_rows(name, _TWIN(), seeds, workshop, recipe)
    drawn = [(part.said, arm, runs) for part, arm, runs in every]
    return rows, draw_table(name, drawn, folder, workshop, recipe, seeds)


def _jobs(part: Part, seeds: Sequence[int], recipe: Recipe) -> list[Job]:
    return jobs_for(part.tasks, part.arm(), part.controllers, seeds, recipe, part.conditions)


def _other_needs(name: str, seeds: Sequence[int], recipe: Recipe) -> list[Need]:
    """What a table is made of beside runs."""
    if name == "networks":
        return [Need("networks", arm, seed, recipe) for arm in (_TWIN(), _SIMULATED()) for seed in seeds]
    if name == "workspace":
        return [Need("recording", _TWIN(), seed, recipe, babbling) for babbling in EXTENTS for seed in seeds]
    return []


def mean_rows(rows: Sequence[Row]) -> list[Row]:
    """Means over the six tilt tasks, of every controller and metric, the paper's beside them."""
    means = []
    for controller, metric in dict.fromkeys((row.controller, row.metric) for row in rows if row.task in TILTS):
        mine = [row for row in rows if row.task in TILTS and (row.controller, row.metric) == (controller, metric)]
        means.append(
            replace(
                mine[0],
                task=f"mean of {len(mine)} tilt tasks",
                mean=sum(row.mean for row in mine) / len(mine),
                std_steps=_mean([row.std_steps for row in mine]),
                std_seeds=None,
                paper_mean=_mean([row.paper_mean for row in mine]),
                paper_std=_mean([row.paper_std for row in mine]),
            )
        )
    return means


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if len(known) == len(values) else None
