"""What each ingredient of the `best` recipe is worth: left out of it, or alone beside the paper's (docs/recipe.md)."""

from collections.abc import Sequence
from dataclasses import replace

from s2c2a.arm import load_arm
from s2c2a.evaluation.report import Row
from s2c2a.jobs import Make, in_groups, jobs_for, score_rows
from s2c2a.models import ChainOptions
from s2c2a.planning import Adam, LeastSquares
from s2c2a.planning.terms import Evenness
from s2c2a.strategies import RECIPES, Recipe
from s2c2a.studies.tables import HOLDING

TASKS = ("circle", "tilt-60", "tilt-0", *HOLDING)
"""The plain one, those at the edge of what bends can do, and those that hold an end."""
_BEST, _PAPER = RECIPES["best"], RECIPES["paper"]
_UNEVEN = tuple(term for term in _BEST.planner.terms if term != Evenness())

VARIANTS: dict[str, Recipe] = {
    "best": _BEST,
    "best, no memory at all": replace(_BEST, c2s=ChainOptions(play_widths=(), creep_times=())),
    "best, no creep": replace(_BEST, c2s=ChainOptions(creep_times=())),
    "best, no statics of cables": replace(_BEST, c2s=ChainOptions(statics=False)),
    "best, no memory, no statics": replace(_BEST, c2s=ChainOptions(play_widths=(), creep_times=(), statics=False)),
    "best, the paper's C2S": replace(_BEST, c2s=_PAPER.c2s, c2s_fit=_PAPER.c2s_fit),
    "best, the paper's planner": replace(_BEST, planner=_PAPER.planner),
    "best, true slopes": replace(_BEST, planner=replace(_BEST.planner, engaged_slopes=False)),
    "best, no evenness": replace(_BEST, planner=replace(_BEST.planner, terms=_UNEVEN)),
    "best, 5 iterations": replace(_BEST, planner=replace(_BEST.planner, solver=LeastSquares(5))),
    "best, 60 iterations": replace(_BEST, planner=replace(_BEST.planner, solver=LeastSquares(60))),
    "best, no integral correction": replace(_BEST, correction=0.0),
    "best, the paper's weights": replace(_BEST, axis_weights=()),
    "best, data as fast as the paper recipe's": replace(_BEST, speeds=_PAPER.speeds),
    "best, a network twice as wide": replace(_BEST, c2s=ChainOptions(hidden=128)),
    "paper": _PAPER,
    "paper, slower data": replace(_PAPER, speeds=_BEST.speeds),
    "paper, integral correction": replace(_PAPER, correction=_BEST.correction),
    "paper, 60 iterations": replace(_PAPER, planner=replace(_PAPER.planner, solver=Adam(iterations=60))),
    "paper, least squares": replace(_PAPER, planner=_BEST.planner),
}
"""Name -> recipe; in the rows the name stands where a strategy's does."""


def ingredient_rows(seeds: Sequence[int], make: Make, arm: str = "twin_arm") -> list[Row]:
    """Six tasks with every variant, once a seed.

    Args:
        seeds: of data, training and start.
        make: finds or makes runs.
        arm: a preset or an arm file.
    """
    spec = load_arm(arm)
    every = in_groups(make, [jobs_for(TASKS, spec, ("s2c2a",), seeds, recipe) for recipe in VARIANTS.values()])
    return [
        replace(row, strategy=name, paper_mean=None, paper_std=None)
        for name, runs in zip(VARIANTS, every, strict=True)
        for row in score_rows("ingredients", runs)
    ]
