"""Command `s2c2a demo`: the whole pipeline on both simulated arms."""

from s2c2a.cli.console import print_results
from s2c2a.cli.execution import ALL_CORES, Work, run_directory

ARMS = ("twin_arm", "simulated_arm")
STRATEGIES = ("s2c2a", "pcc", "pcc-fitted")


def demo(seed: int = 0, work: Work = ALL_CORES) -> None:
    """Run the whole pipeline on both simulated arms: collect, train, follow a circle.

    The last step compares the errors with those of the paper.

    Args:
        seed: random seed.
        work: run directory and parallel execution.
    """
    from s2c2a import jobs
    from s2c2a.arm import load_arm
    from s2c2a.jobs.run_folder import draw_runs, save_results
    from s2c2a.strategies import recipe_named

    recipe = recipe_named("best")
    arms = [load_arm(name) for name in ARMS]
    groups = [
        jobs.jobs_for(["circle"], arm, STRATEGIES, [seed], recipe) for arm in arms
    ]
    with run_directory("demo", {"seed": seed}, work, own_data=True) as (
        directory,
        make,
    ):
        rows = []
        runs_by_arm = jobs.in_groups(make, groups)
        for arm, runs in zip(arms, runs_by_arm, strict=True):
            trained = make([jobs.NetworksArtifact.of_recipe(arm, recipe, seed)])
            rows += jobs.score_rows("circle", runs)
            rows += jobs.training_rows("circle", trained)
        save_results(directory, rows, [run for runs in runs_by_arm for run in runs])
        drawn = [path for runs in runs_by_arm for path in draw_runs(directory, runs)]
    print_results("Following a circle: ours and the paper's", rows, drawn, directory)
