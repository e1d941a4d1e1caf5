"""`s2c2a demo`: from nothing to a table, a figure and a replay page."""

from s2c2a.cli.console import print_results
from s2c2a.cli.work import NEW_FOLDER, Folder, making


def demo(seed: int = 0, folder: Folder = NEW_FOLDER) -> None:
    """Run the whole pipeline on both simulated arms: collect, train, follow a circle, compare with the paper.

    Args:
        seed: of everything random.
        folder: where results go.
    """
    from s2c2a.strategies import recipe_named
    from s2c2a.studies.circle import circle_table

    with making("demo", {"seed": seed}, folder, own_data=True) as (place, make):
        rows, pictures = circle_table(place, [seed], make, recipe_named("best"))
    print_results("Following a circle: ours and the paper's", rows, pictures, place)
