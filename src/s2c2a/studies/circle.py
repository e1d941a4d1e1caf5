"""The circle on both arms, with the paper's strategy and its comparisons."""

from collections.abc import Sequence
from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.evaluation.report import Row
from s2c2a.jobs import Conditions, Make, NetworksArtifact, in_groups, jobs_for, score_rows, training_rows
from s2c2a.jobs.run_folder import draw_runs, save_results
from s2c2a.robots import Body
from s2c2a.strategies import Recipe

ARMS = ("twin_arm", "simulated_arm")
STRATEGIES = ("s2c2a", "pcc", "pcc-fitted")


def circle_table(
    folder: Path, seeds: Sequence[int], make: Make, recipe: Recipe, fidelity: str = "fast"
) -> tuple[list[Row], list[Path]]:
    """Let every strategy go round on both arms, once a seed; results and pictures go to the folder.

    Args:
        folder: the run folder.
        seeds: of data, training and start.
        make: finds or makes runs and networks.
        recipe: how networks are trained and plans made.
        fidelity: of the simulation that is driven.

    Returns:
        Its rows; and the pictures, a figure and a replay page for each arm.
    """
    arms, under = [load_arm(name) for name in ARMS], Conditions(Body.simulation(fidelity))
    every = in_groups(make, [jobs_for(["circle"], arm, STRATEGIES, seeds, recipe, under) for arm in arms])
    rows: list[Row] = []
    pictures: list[Path] = []
    for arm, runs in zip(arms, every, strict=True):
        trained = make([NetworksArtifact(arm, recipe, seed) for seed in seeds])
        rows += score_rows("circle", runs) + training_rows("circle", trained)
        pictures += draw_runs(folder, runs)
    save_results(folder, rows, [run for runs in every for run in runs])
    return rows, pictures
