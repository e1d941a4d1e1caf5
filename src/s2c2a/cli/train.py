"""`s2c2a train`: the two networks of an arm."""

from pathlib import Path

from s2c2a.cli.console import File, RecipeName, print_table, progress_bar
from s2c2a.errors import StrategyError
from s2c2a.executors import compute_on_one_thread


def train(recording: File, out: Path, recipe: RecipeName = "best", seed: int = 0, overwrite: bool = False) -> None:
    """Train both networks on a recording, and draw their learning curves beside the file.

    Args:
        recording: made by `s2c2a collect` or `s2c2a import`.
        out: the strategy to write, such as twin.safetensors.
        recipe: how to train.
        seed: of everything random.
        overwrite: replace the strategy if it exists.
    """
    from s2c2a import strategies, viz
    from s2c2a.data import load_recording
    from s2c2a.estimation.margins import CARRIED, margins_of

    compute_on_one_thread()
    if out.exists() and not overwrite:
        raise StrategyError(f"{out} exists; say --overwrite or choose another --out")
    data, chosen = load_recording(recording), strategies.recipe_from(recipe)
    out.parent.mkdir(parents=True, exist_ok=True)  # a place that cannot be is told before the long work
    with progress_bar() as progress:

        def told(name: str, epoch: int, most: int, loss: float) -> None:
            progress(f"training {name}", epoch, most)

        networks = strategies.train_s2c2a(data, chosen, seed, told)
    strategies.save_strategy(networks, out)
    columns = ("epoch", "train", "validation")
    curves = {name: [dict(zip(columns, row, strict=True)) for row in rows] for name, rows in networks.curves.items()}
    picture = viz.learning_curves(curves, Path(f"{out}.png"))
    held_out = [(name, f"{mean:.2f} ± {spread:.2f} %") for name, (mean, spread) in networks.percent.items()]
    print_table("Held-out errors, of full range", ("network", "error"), held_out)
    if chosen.observes and (observer := strategies.observer_of(networks)).senses:
        found = margins_of(networks.arm, observer)
        print(f"margins of the loop, with up to {CARRIED:g} of the arm's mass at its tip: {found}")
    print(f"strategy: {out}; learning curves: {picture}")
