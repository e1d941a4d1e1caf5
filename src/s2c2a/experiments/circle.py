"""The circle on both arms, with the paper's strategy and its comparisons."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.evaluation.report import Row
from s2c2a.experiments.ahead import jobs_for, make_all_ahead, shelf_for
from s2c2a.experiments.following import Conditions, Run, follow, score_rows, training_rows, workshop_strategies
from s2c2a.experiments.run_folder import draw_runs, save_results
from s2c2a.experiments.workshop import Workshop
from s2c2a.shards import Crew
from s2c2a.strategies import recipe_from

ARMS = ("twin_arm", "simulated_arm")
CONTROLLERS = ("s2c2a", "pcc", "pcc-fitted")


@dataclass(frozen=True)
class CircleTable:
    """Rows of the table, and a figure and a replay page for each arm."""

    rows: list[Row]
    pictures: list[tuple[Path, Path]]


def circle_table(
    folder: Path,
    seeds: Sequence[int],
    workshop: Workshop,
    recipe: str = "best",
    fidelity: str = "fast",
    crew: Crew | None = None,
) -> CircleTable:
    """Follow the circle with every controller on both arms, once a seed; results and pictures go to the folder.

    Args:
        folder: the run folder.
        seeds: of data, training and start.
        workshop: where data and networks come from.
        recipe: how networks are trained and plans made.
        fidelity: of the simulation that is driven.
        crew: who trains and runs; this process if None.
    """
    chosen, under = recipe_from(recipe), Conditions(fidelity)
    shelf = shelf_for(chosen, folder / "runs")
    if crew is not None:
        jobs = [job for name in ARMS for job in jobs_for(["circle"], load_arm(name), CONTROLLERS, seeds, chosen, under)]
        make_all_ahead(jobs, folder / "runs", workshop, crew)
    rows: list[Row] = []
    pictures: list[tuple[Path, Path]] = []
    every: list[Run] = []
    for name in ARMS:
        arm = load_arm(name)
        trained = [workshop.networks(arm, chosen, seed) for seed in seeds]
        strategies = workshop_strategies(workshop, arm, chosen)
        runs = follow(["circle"], arm, CONTROLLERS, seeds, strategies, chosen, under, shelf, workshop.progress)
        rows += score_rows("circle", arm, runs, chosen.name, fidelity)
        rows += training_rows("circle", trained, workshop.fidelity)
        pictures.append(draw_runs(folder, arm, runs, chosen.name, fidelity))
        every += runs
    save_results(folder, rows, every)
    return CircleTable(rows, pictures)
