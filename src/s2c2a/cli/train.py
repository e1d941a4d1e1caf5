"""`s2c2a train`: the networks of a strategy."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.arm import load_arm
from s2c2a.cli.console import (
    OptionalArm,
    RecipeName,
    StrategyName,
    print_held_out_errors,
    progress_bar,
)
from s2c2a.cli.dependent_options import effective
from s2c2a.cli.execution import uses_recipe
from s2c2a.errors import StrategyError, listed
from s2c2a.execution.executors import limit_jax_to_one_thread

if TYPE_CHECKING:
    from s2c2a.strategies import TrainedNetworks


READING = "reading the data"
Recorded = tyro.conf.Positional[Annotated[str, tyro.conf.arg(metavar="NAME|FILE")]]
Start = Annotated[Path | None, tyro.conf.arg(name="from", metavar="FILE")]


@effective(
    "recipe",
    where="with a strategy that uses a recipe",
    holds=lambda given: uses_recipe(given["strategy"]),
)
def train(
    recording: Recorded,
    out: Path,
    strategy: StrategyName = "s2c2a",
    recipe: RecipeName = "best",
    start: Start = None,
    arm: OptionalArm = None,
    seed: int = 0,
    overwrite: bool = False,
) -> None:
    """Train the networks of a strategy on a recording; draw the learning curves.

    With --from, training starts from a prior of `s2c2a pretrain`, and a short recording
    will do: `s2c2a collect --arm mine.toml --babbling motor --episodes 5 --samples 100`.

    Args:
        recording: of `s2c2a collect` or `s2c2a import`.
        out: weight file to write, such as twin.safetensors.
        strategy: whose networks, by name or your own file.py:Class.
        recipe: how to train.
        start: weight file of a prior over variants of the arm (`s2c2a pretrain`).
        arm: a preset or an arm file of the recorded arm; allows the code that it names,
            such as your own sensor.
        seed: of everything random.
        overwrite: replace the weight file if it exists.
    """
    with progress_bar() as progress:
        progress(READING, 0, 1)  # before slow imports
        from s2c2a import strategies, viz
        from s2c2a.data import load_recording

        limit_jax_to_one_thread()
        strategies.check_new_networks(out, overwrite)
        chosen = strategies.recipe_from(recipe)
        begun = strategies.load_networks(start) if start else None
        options = strategies.strategy_named(strategy)
        if begun is not None and type(options) is not strategies.S2C2A:
            raise StrategyError(f"--from works with s2c2a alone, not with {strategy}")
        spec = load_arm(arm) if arm else None
        data = load_recording(recording)
        progress(READING, 1, 1)
        if spec is not None and spec.differences(data.arm):
            raise StrategyError(
                f"{recording} is of '{data.arm.name}', which differs from {arm} in "
                f"{listed(data.arm.differences(spec))}; leave out --arm, or give the arm "
                "file that it was recorded with"
            )

        def on_epoch(network: str, epoch: int, epochs: int, loss: float) -> None:
            progress(f"training {network}", epoch, epochs)

        if begun is not None:
            networks = strategies.train_s2c2a(data, chosen, seed, on_epoch, begun)
        else:
            networks = strategies.train_networks(data, chosen, strategy, seed, on_epoch)
    strategies.save_networks(networks, out)
    curves = {name: result.curve for name, result in networks.trained.items()}
    picture = viz.learning_curves(curves, Path(f"{out}.png"))
    print(f"weights: {out}; learning curves: {picture}")
    report(networks, begun)


def report(networks: "TrainedNetworks", start: "TrainedNetworks | None") -> None:
    """Print the held-out errors, data to record, and the modal model.

    Args:
        networks: that were trained.
        start: networks that the training started from, if any.
    """
    from s2c2a import evaluation

    title = "Held-out errors, in percent of the full range"
    if start is not None:
        title += "; networks that were not trained here are those of the prior"
    print_held_out_errors(title, networks)
    # a training that starts from a prior keeps its modal model
    if start is None and (text := evaluation.describe_modal_model(networks)):
        print(text)
    # a warning comes last
    for line in evaluation.describe_held_out_errors(networks):
        print(line)
