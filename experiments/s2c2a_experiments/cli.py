"""Command `s2c2a reproduce`: the project's tables, each with its published settings."""

import inspect
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import tyro

from s2c2a.cli.console import (
    Count,
    OptionalPath,
    OptionalRecipe,
    StrategyNames,
    print_results,
)
from s2c2a.cli.execution import ALL_CORES, Work, run_directory
from s2c2a.errors import S2C2AError, counted, no_such
from s2c2a_experiments import beyond_the_paper
from s2c2a_experiments.everything import everything

Parts = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")]
PAPER = {
    "simulation": "Table I: ours, motor babbling, lstm and pcc, with both couplings",
    "tracking": "Table III: circle and tilt tasks; other arms; 50 g at the tip",
    "constraint": "Table V: the end of one module holds its position",
    "obstacles": "reaching past obstacles at three risk levels, guarding tip or arm",
    "interaction": "a moving obstacle and a moving target",
    "paths": "square, eight, helix and star, which need S-shaped arms",
    "networks": "Table II: held-out errors of both networks",
    "workspace": "estimation errors and workspaces of section II-D",
}


def _paper_tables(
    label: str,
    names: tuple[str, ...],
    recipe: str = "best",
    strategy: tuple[str, ...] = (),
    seeds: int = 5,
    beside: OptionalPath = None,
    work: Work = ALL_CORES,
) -> None:
    """Make tables of the paper, all of which compare strategies trained by a recipe."""
    from s2c2a import jobs
    from s2c2a.strategies import RECIPES, recipe_from
    from s2c2a_experiments import table_files, tables

    numbers = jobs.checked_seeds(0, seeds)
    chosen = recipe_from(recipe)
    tables.check_strategies(names, strategy)
    options = {
        "tables": names,
        "recipe": recipe if recipe in RECIPES else asdict(chosen),
        "strategies": strategy,
        "seeds": seeds,
    }
    with run_directory(f"{label}-{chosen.name}", options, work, resume=True) as (
        directory,
        make,
    ):
        for table in names:
            # the tables of `all` that compare no strategies are made as they are
            is_compared = len(names) == 1 or table in tables.TABLES
            added = strategy if is_compared else ()
            rows, figures = tables.make_table(
                table, directory, numbers, make, chosen, added
            )
            compared = table_files.load_comparison(beside, table)
            path = table_files.save_table(table, rows, directory, compared)
            title = f"{table}, recipe {chosen.name}, {counted(seeds, 'seed')}"
            print_results(title, rows, figures, directory)
            print(f"table: {path} (.csv, .json next to it)")


TABLES: dict[str, tuple[str, Callable[..., None]]] = {
    name: (summary, partial(_paper_tables, name, (name,)))
    for name, summary in PAPER.items()
}
"""Name -> summary, and a function whose parameters are the options that it takes."""
TABLES["all"] = (
    "all tables of the paper",
    partial(_paper_tables, "all", tuple(name for name in PAPER if name != "paths")),
)
TABLES |= beyond_the_paper.TABLES
TABLES["everything"] = (
    "all rows of results/, in parts that are kept",
    partial(everything, TABLES),
)


def reproduce(
    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")],
    files: Annotated[
        tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE ...")
    ] = (),
    seeds: Count = None,
    arm: Annotated[str | None, tyro.conf.arg(metavar="PRESET|FILE")] = None,
    recipe: OptionalRecipe = None,
    strategy: StrategyNames = (),
    beside: OptionalPath = None,
    smoke: bool = False,
    only: Parts = (),
    work: Work = ALL_CORES,
) -> None:
    """Make one of the project's tables from scratch, with its settings.

    Data and networks are kept in the cache (the environment variable S2C2A_CACHE moves
    it). Repeat the command to continue an interrupted run. An option without effect on a
    table is refused. The tables:

    {tables}

    Args:
        name: of the table.
        files: what some tables are made from.
        seeds: number of seeds, from zero; each sets data, training and start.
        arm: a preset or an arm file, in the place of the table's.
        recipe: training of the networks and planning.
        strategy: further strategies to compare, by name or your own file.py:Class.
        beside: run directory of the same tables with another recipe, to compare with.
        smoke: of `everything`, three parts that take minutes together.
        only: of `everything`, these parts.
        work: run directory and parallel execution.
    """
    if name not in TABLES:
        raise S2C2AError(no_such("table", name, TABLES))
    given = {
        "files": files or None,
        "seeds": seeds,
        "arm": arm,
        "recipe": recipe,
        "strategy": strategy or None,
        "beside": beside,
        "smoke": smoke or None,
        "only": only or None,
    }
    options: dict[str, Any] = {
        key: value for key, value in given.items() if value is not None
    }
    _, make = TABLES[name]
    taken = inspect.signature(make).parameters
    without_effect = [key for key in options if key not in taken]
    if without_effect:
        words = ["FILE" if key == "files" else f"--{key}" for key in without_effect]
        raise S2C2AError(
            f"{' and '.join(words)} would have no effect on the table '{name}'; leave "
            f"out {' and '.join(words)}"
        )
    required = inspect.Parameter.empty
    if not files and "files" in taken and taken["files"].default is required:
        raise S2C2AError(f"the table '{name}' is made from files; name them")
    try:
        make(**options, work=work)
    except KeyboardInterrupt:
        print("finished work is kept: repeat the command to continue")
        raise


_LINES = [f"- {name}: {summary}." for name, (summary, _) in TABLES.items()]
reproduce.__doc__ = str(reproduce.__doc__).format(tables="\n    ".join(_LINES))
