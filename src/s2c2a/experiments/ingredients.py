"""What each ingredient of the `best` recipe is worth: left out of it, or alone beside the paper's (docs/recipe.md)."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.evaluation.report import Row
from s2c2a.experiments.ahead import jobs_for, make_all_ahead, shelf_for
from s2c2a.experiments.following import follow, score_rows, workshop_strategies
from s2c2a.experiments.tables import HOLDING
from s2c2a.experiments.workshop import Workshop
from s2c2a.networks import ChainSize
from s2c2a.planning import LeastSquaresOptions, PlannerOptions
from s2c2a.shards import Crew
from s2c2a.strategies import RECIPES, Recipe

TASKS = ("circle", "tilt-60", "tilt-0", *HOLDING)
"""The plain one, those at the edge of what bends can do, and those that hold an end."""
_BEST, _PAPER = RECIPES["best"], RECIPES["paper"]

VARIANTS: dict[str, Recipe] = {
    "best": _BEST,
    "best, no memory at all": replace(_BEST, c2s=ChainSize(play_widths=(), creep_times=())),
    "best, no creep": replace(_BEST, c2s=ChainSize(creep_times=())),
    "best, no statics of cables": replace(_BEST, c2s=ChainSize(statics=False)),
    "best, no memory, no statics": replace(_BEST, c2s=ChainSize(play_widths=(), creep_times=(), statics=False)),
    "best, the paper's C2S": replace(_BEST, c2s=_PAPER.c2s, c2s_fit=_PAPER.c2s_fit),
    "best, the paper's planner": replace(_BEST, planner=PlannerOptions()),
    "best, true slopes": replace(_BEST, planner=LeastSquaresOptions(engaged_slopes=False)),
    "best, no evenness": replace(_BEST, planner=LeastSquaresOptions(evenness=0.0)),
    "best, 5 iterations": replace(_BEST, planner=LeastSquaresOptions(iterations=5)),
    "best, 60 iterations": replace(_BEST, planner=LeastSquaresOptions(iterations=60)),
    "best, no integral correction": replace(_BEST, correction=0.0),
    "best, the paper's weights": replace(_BEST, axis_weights=()),
    "best, data as fast as the paper recipe's": replace(_BEST, speeds=_PAPER.speeds),
    "best, a network twice as wide": replace(_BEST, c2s=ChainSize(hidden=128)),
    "paper": _PAPER,
    "paper, slower data": replace(_PAPER, speeds=_BEST.speeds),
    "paper, integral correction": replace(_PAPER, correction=_BEST.correction),
    "paper, 60 iterations": replace(_PAPER, planner=PlannerOptions(iterations=60)),
    "paper, least squares": replace(_PAPER, planner=LeastSquaresOptions()),
}
"""Name -> recipe; in the rows the name stands where a controller's does."""


def ingredient_rows(
    folder: Path, seeds: Sequence[int], workshop: Workshop, arm: str = "twin_arm", crew: Crew | None = None
) -> list[Row]:
    """Six tasks with every variant, once a seed.

    Args:
        folder: for finished runs.
        seeds: of data, training and start.
        workshop: where data and networks come from.
        arm: a preset or an arm file.
        crew: who trains and runs; this process if None.
    """
    spec = load_arm(arm)
    if crew is not None:
        every = [job for recipe in VARIANTS.values() for job in jobs_for(TASKS, spec, ("s2c2a",), seeds, recipe)]
        make_all_ahead(every, folder / "runs", workshop, crew)
    rows = []
    for name, recipe in VARIANTS.items():
        shelf = shelf_for(recipe, folder / "runs")
        strategies = workshop_strategies(workshop, spec, recipe)
        runs = follow(TASKS, spec, ("s2c2a",), seeds, strategies, recipe, shelf=shelf, progress=workshop.progress)
        own = score_rows("ingredients", spec, runs, recipe.name, workshop.fidelity)
        rows += [replace(row, controller=name, paper_mean=None, paper_std=None) for row in own]
    return rows
