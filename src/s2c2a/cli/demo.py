"""Command `s2c2a demo`: the whole pipeline on both simulated arms."""

from s2c2a.cli.console import print_results
from s2c2a.cli.execution import ALL_CORES, Work, run_directory


def demo(seed: int = 0, work: Work = ALL_CORES) -> None:
    """Run the whole pipeline on both simulated arms: collect, train, follow a circle.

    The last step compares the errors with those of the paper.

    Args:
        seed: random seed.
        work: run directory and parallel execution.
    """
    from s2c2a.jobs.circle import circle_table
    from s2c2a.strategies import recipe_named

    recipe = recipe_named("best")
    with run_directory("demo", {"seed": seed}, work, own_data=True) as (
        directory,
        make,
    ):
        rows, pictures = circle_table(directory, [seed], make, recipe)
    print_results("Following a circle: ours and the paper's", rows, pictures, directory)
