"""`s2c2a demo`: from nothing to a table, a figure and a replay page."""

from pathlib import Path


def demo(out: Path | None = None, seed: int = 0, overwrite: bool = False) -> None:
    """Run the whole pipeline on both simulated arms: collect, train, follow a circle, compare with the paper.

    Args:
        out: the run folder; one with the time in its name if not stated.
        seed: of everything random.
        overwrite: replace the run folder if it exists.
    """
    from s2c2a.cli.console import print_rows, progress_bar
    from s2c2a.experiments.circle import circle_table
    from s2c2a.experiments.run_folder import open_run_folder
    from s2c2a.experiments.workshop import Workshop
    from s2c2a.shards import compute_on_one_thread

    compute_on_one_thread()
    folder = open_run_folder(out, "demo", {"seed": seed}, overwrite)
    with progress_bar() as progress:
        table = circle_table(folder, [seed], Workshop(folder / "data", progress=progress))
    print_rows("Following a circle: ours and the paper's", table.rows)
    for figure, page in table.pictures:
        print(f"figure: {figure}\nreplay: {page}")
