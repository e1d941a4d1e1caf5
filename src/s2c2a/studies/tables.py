"""The paper's tables and figures: which arms, tasks and strategies each is made of, and how it is made."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from s2c2a import jobs
from s2c2a.arm import ArmSpec, load_arm
from s2c2a.errors import ArmError, S2C2AError
from s2c2a.evaluation.report import Row
from s2c2a.jobs import Conditions, Make, Run
from s2c2a.robots import Body
from s2c2a.sensing import PAPER_COUPLING
from s2c2a.strategies import Recipe
from s2c2a.studies import table_figures
from s2c2a.studies.calibration import sensing_rows
from s2c2a.tasks.registry import TILTS

PAYLOAD = 0.05  # kg
SIBLINGS = ("twin_capstan", "twin_creep", "twin_both")
TRACKING = ("circle", *TILTS)
HOLDING = ("hold-base", "hold-middle", "hold-end")
AVOIDING = ("reach-0", "reach-1", "reach-2", "risk-a", "risk-b", "risk-c")
COMPARED = ("s2c2a", "pcc", "pcc-fitted")

More = Callable[[Make, Sequence[int], Recipe, Path], tuple[list[Row], list[Path]]]


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
    conditions: Conditions = jobs.SIMULATED_FAST
    said: str = ""

    def jobs(self, seeds: Sequence[int], recipe: Recipe) -> list[jobs.Job]:
        """What is to be run."""
        return jobs.jobs_for(self.tasks, self.arm(), self.strategies, seeds, recipe, self.conditions)

    def rows(self, table: str, runs: Sequence[Run]) -> list[Row]:
        """Scores, their means over tilt tasks, and the times of control steps."""
        experiment = f"{table}, {self.said}" if self.said else table
        own = jobs.score_rows(experiment, runs)
        if "payload" in dict(self.conditions.body.options):  # the paper loads its arm with nothing
            own = [replace(row, paper_mean=None, paper_std=None) for row in own]
        return own + mean_rows(own) + jobs.tick_rows(experiment, runs)


@dataclass(frozen=True)
class Table:
    """What a table is made of.

    Attributes:
        blocks: its runs.
        draw: figures of these into a folder.
        more: what else it has: its rows and figures.
    """

    blocks: tuple[Block, ...] = ()
    draw: Callable[[table_figures.Drawn, Path], list[Path]] = lambda drawn, folder: []
    more: More = lambda make, seeds, recipe, folder: ([], [])


def sensing_coupled(arm: ArmSpec) -> ArmSpec:
    """Sensors that pass through the whole arm (Chen et al. 2025, eq. (11)).

    Raises:
        ArmError: not an arm of three modules.
    """
    if arm.module_count != len(PAPER_COUPLING):
        raise ArmError(f"the paper's sensing coupling is for three modules; '{arm.name}' has {arm.module_count}")
    coupled = {"name": f"{arm.name}_sensing_coupled", "sensing_coupling": PAPER_COUPLING}
    return ArmSpec.model_validate(arm.model_dump() | coupled)


def actuation_coupled(arm: ArmSpec) -> ArmSpec:
    """Cables that pass through all modules below their own (Chen et al. 2025, fig. 9C).

    Tensions are halved: those of all modules add up at the base, which would otherwise bend three times as far.
    """
    described = arm.model_dump() | {"name": f"{arm.name}_actuation_coupled", "coupled_cables": True}
    for module in described["modules"]:
        for tension in ("pretension", "tension_range"):
            if module.get(tension):
                module[tension] = module[tension] / 2
    return ArmSpec.model_validate(described)


def _network_errors(make: Make, seeds: Sequence[int], recipe: Recipe, folder: Path) -> tuple[list[Row], list[Path]]:
    every = [[jobs.NetworksArtifact(arm(), recipe, seed) for seed in seeds] for arm in (_TWIN, _SIMULATED)]
    return [row for trained in jobs.in_groups(make, every) for row in jobs.training_rows("networks", trained)], []


def _workspace(make: Make, seeds: Sequence[int], recipe: Recipe, folder: Path) -> tuple[list[Row], list[Path]]:
    rows, recording = sensing_rows("workspace", _TWIN(), seeds, make, recipe)
    return rows, table_figures.workspace(recording, folder)


_TWIN, _SIMULATED = partial(load_arm, "twin_arm"), partial(load_arm, "simulated_arm")

TABLES: dict[str, Table] = {
    "simulation": Table(
        (
            Block(_SIMULATED, ("circle",), ("s2c2a", "s2c2a-motor", "lstm", "pcc", "pcc-fitted")),
            Block(lambda: sensing_coupled(_SIMULATED()), ("circle",)),
            Block(lambda: actuation_coupled(_SIMULATED()), ("circle",)),
        ),
        table_figures.simulation,
    ),
    "tracking": Table(
        (
            Block(_TWIN, TRACKING, COMPARED),
            *(Block(partial(load_arm, name), TRACKING, said="other hysteresis") for name in SIBLINGS),
            Block(_TWIN, ("circle",), COMPARED, Conditions(Body.simulation(payload=PAYLOAD)), "50 g at the tip"),
        ),
        table_figures.tracking,
    ),
    "constraint": Table((Block(_TWIN, HOLDING, COMPARED),), table_figures.constraint),
    "obstacles": Table(
        (
            Block(_TWIN, AVOIDING),
            Block(_TWIN, AVOIDING[1:], conditions=Conditions(guard="arm"), said="whole arm guarded"),
        ),
        table_figures.obstacles,
    ),
    "interaction": Table((Block(_TWIN, ("flee", "follow")),), table_figures.interaction),
    "networks": Table(more=_network_errors),
    "workspace": Table(more=_workspace),
}
"""Name -> what it is made of (Chen et al. 2025, secs. II-D, III-B and IV)."""


def make_table(
    name: str, folder: Path, seeds: Sequence[int], make: Make, recipe: Recipe
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
    if name not in TABLES:
        raise S2C2AError(f"no table '{name}'; choose one of {', '.join(TABLES)}, or all")
    table = TABLES[name]
    every = jobs.in_groups(make, [block.jobs(seeds, recipe) for block in table.blocks])
    rows = [row for block, runs in zip(table.blocks, every, strict=True) for row in block.rows(name, runs)]
    folder.mkdir(parents=True, exist_ok=True)
    figures = table.draw([(block.said, runs) for block, runs in zip(table.blocks, every, strict=True)], folder)
    more_rows, more_figures = table.more(make, seeds, recipe, folder)
    return rows + more_rows, figures + more_figures


def mean_rows(rows: Sequence[Row]) -> list[Row]:
    """Means over the six tilt tasks, of every strategy and metric, the paper's beside them."""
    means = []
    for strategy, metric in dict.fromkeys((row.strategy, row.metric) for row in rows if row.task in TILTS):
        mine = [row for row in rows if row.task in TILTS and (row.strategy, row.metric) == (strategy, metric)]
        averaged: dict[str, Any] = {
            name: _mean([getattr(row, name) for row in mine])
            for name in ("mean", "std_steps", "paper_mean", "paper_std")
        }
        means.append(replace(mine[0], task=f"mean of {len(mine)} tilt tasks", std_seeds=None, **averaged))
    return means


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if len(known) == len(values) else None
