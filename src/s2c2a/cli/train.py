"""`s2c2a train`: the two networks of an arm."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import RecipeName, print_table, progress_bar
from s2c2a.errors import StrategyError
from s2c2a.executors import compute_on_one_thread

if TYPE_CHECKING:
    from s2c2a.strategies import Recipe, TrainedNetworks


Recorded = tyro.conf.Positional[
    Annotated[str | None, tyro.conf.arg(metavar="NAME|FILE")]
]
OptionalArm = Annotated[str | None, tyro.conf.arg(metavar="PRESET|FILE")]
Start = Annotated[Path | None, tyro.conf.arg(name="from", metavar="FILE")]


def train(
    out: Path,
    recording: Recorded = None,
    recipe: RecipeName = "best",
    start: Start = None,
    arm: OptionalArm = None,
    seed: int = 0,
    overwrite: bool = False,
) -> None:
    """Train both networks on a recording, and draw their learning curves beside the file.

    With --from, networks of another arm of the same make are begun from, its module
    count may differ, and a short recording will do (docs/transfer.md): `s2c2a collect
    --arm mine.toml --babbling motor --episodes 5 --samples 100`.

    Args:
        out: the strategy to write, such as twin.safetensors.
        recording: made by `s2c2a collect` or `s2c2a import`; with --from and --arm
            there need be none.
        recipe: how to train.
        start: a strategy of another arm to begin from.
        arm: a preset or an arm file, where there is no recording of it.
        seed: of everything random.
        overwrite: replace the strategy if it exists.
    """
    from s2c2a import strategies, viz
    from s2c2a.estimation.margins import CARRIED, margins_of

    compute_on_one_thread()
    if out.exists() and not overwrite:
        raise StrategyError(f"{out} exists; say --overwrite or choose another --out")
    chosen = strategies.recipe_from(recipe)
    begun = strategies.load_strategy(start) if start else None
    networks = _learned(recording, arm, chosen, seed, begun, out)
    strategies.save_strategy(networks, out)
    columns = ("epoch", "train", "validation")
    curves = {
        name: [dict(zip(columns, row, strict=True)) for row in rows]
        for name, rows in networks.curves.items()
    }
    picture = viz.learning_curves(curves, Path(f"{out}.png"))
    held_out = [
        (name, f"{mean:.2f} ± {spread:.2f} %")
        for name, (mean, spread) in networks.percent.items()
    ]
    where = "" if begun is None else f"; what was not trained here, of {begun.arm.name}"
    print_table(
        f"Held-out errors, of full range{where}", ("network", "error"), held_out
    )
    if networks.percent.get("swing", (0.0,))[0] >= 100.0:
        print(
            "how it swings does not show in this recording, and is taken from the description: margins are a guess"
        )
    if chosen.observes and (observer := strategies.observer_of(networks)).sensors:
        found = margins_of(networks.arm, observer)
        print(
            f"margins of the loop, with up to {CARRIED:g} of the arm's mass at its tip: {found}"
        )
    print(f"strategy: {out}; learning curves: {picture}")


def _learned(
    recording: str | None,
    arm: str | None,
    recipe: "Recipe",
    seed: int,
    begun: "TrainedNetworks | None",
    out: Path,
) -> "TrainedNetworks":
    """From a recording, from other networks, or from both."""
    from s2c2a import strategies
    from s2c2a.data import load_recording

    if (recording is None) == (arm is None) or (recording is None and begun is None):
        raise StrategyError(
            "say a recording, or --arm and --from FILE for an arm that nothing was recorded of"
        )
    data = load_recording(recording) if recording else None
    # a place that cannot be is told before the long work
    out.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar() as progress:

        def told(name: str, epoch: int, most: int, loss: float) -> None:
            progress(f"training {name}", epoch, most)

        if data is not None:
            return strategies.train_s2c2a(data, recipe, seed, told, begun)
        progress("carrying over what was learned", 0, 1)
        return strategies.transferred(begun, load_arm(arm), seed)  # type: ignore[arg-type]
