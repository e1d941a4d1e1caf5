"""The circle on both arms of the paper, for every strategy: what `s2c2a demo` runs."""

from collections.abc import Sequence
from pathlib import Path

from s2c2a import jobs
from s2c2a.arm import load_arm
from s2c2a.evaluation import Row
from s2c2a.jobs.run_folder import draw_runs, save_results
from s2c2a.robots import RobotFactory
from s2c2a.strategies import Recipe

ARMS = ("twin_arm", "simulated_arm")
STRATEGIES = ("s2c2a", "pcc", "pcc-fitted")


def circle_table(
    folder: Path,
    seeds: Sequence[int],
    make: jobs.Make,
    recipe: Recipe,
    fidelity: str = "fast",
) -> tuple[list[Row], list[Path]]:
    """Run every strategy on the circle with both arms, once a seed.

    Args:
        folder: the run directory, for results and figures.
        seeds: of data, training and start.
        make: loads or makes runs and networks.
        recipe: how networks are trained and plans made.
        fidelity: of the simulated robot.

    Returns:
        The rows; and the files drawn, a figure and a replay page for each arm.
    """
    arms = [load_arm(name) for name in ARMS]
    conditions = jobs.Conditions(RobotFactory.simulation(fidelity))
    groups = [
        jobs.jobs_for(["circle"], arm, STRATEGIES, seeds, recipe, conditions)
        for arm in arms
    ]
    runs_by_arm = jobs.in_groups(make, groups)
    rows: list[Row] = []
    for arm, runs in zip(arms, runs_by_arm, strict=True):
        trained = make(
            [jobs.NetworksArtifact.of_recipe(arm, recipe, seed) for seed in seeds]
        )
        rows += jobs.score_rows("circle", runs)
        rows += jobs.training_rows("circle", trained)
    save_results(folder, rows, [run for runs in runs_by_arm for run in runs])
    return rows, [path for runs in runs_by_arm for path in draw_runs(folder, runs)]
