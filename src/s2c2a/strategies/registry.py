"""Strategies by name."""

import re
from dataclasses import asdict, replace

from s2c2a.data import Recording
from s2c2a.errors import StrategyError
from s2c2a.plugins.components import Registry
from s2c2a.plugins.options import options_of
from s2c2a.runtime import Driver
from s2c2a.runtime.border import named_errors
from s2c2a.strategies.options import NetworkProgress, RunOptions, StrategyOptions
from s2c2a.strategies.pcc import FittedPCC, PlainPCC
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.s2c2a import S2C2A, S2C2AMotor
from s2c2a.strategies.trained import TrainedNetworks

STRATEGIES: Registry[StrategyOptions] = Registry(
    "strategy",
    StrategyOptions,
    {kind.name: kind for kind in (S2C2A, PlainPCC, FittedPCC, S2C2AMotor)},
)
"""The paper's strategy and its comparisons without learning, for `--strategy`."""


OPTION = re.compile(r",(?=\w+=)")  # begins one; other commas are part of a path


def strategy_named(text: str) -> StrategyOptions:
    """A strategy by name, with its options behind commas: `policy.py:Mine,gain=0.5`.

    Raises:
        S2C2AError: no such strategy or option, or a value that it does not take.
        StrategyError: its class is incomplete, or fails.
    """
    name, *given = OPTION.split(text)
    kind = STRATEGIES.named(name)
    options = options_of(kind, given)
    with named_errors(StrategyError, f"strategy '{name}' cannot be made"):
        return kind(**options)


def shown_name(text: str) -> str:
    """The name of `strategy_named(text)` in lists: without the path of its file."""
    _, *given = OPTION.split(text)
    options = strategy_named(text)
    return ",".join([options.name or type(options).__name__, *given])


def labeled(networks: TrainedNetworks, options: StrategyOptions) -> TrainedNetworks:
    """Networks with the strategy that they belong to, as files keep it."""
    return replace(
        networks,
        strategy=STRATEGIES.name_of(type(options)),
        strategy_options=asdict(options),
    )


def train_networks(
    recording: Recording,
    recipe: Recipe,
    strategy: str = "s2c2a",
    seed: int = 0,
    progress: NetworkProgress = lambda *_: None,
) -> TrainedNetworks:
    """Train the networks of a strategy on a recording.

    Args:
        recording: of the arm.
        recipe: how to train.
        strategy: see `strategy_named`.
        seed: of everything random.
        progress: called with network, epoch, number of epochs, validation loss.

    Raises:
        S2C2AError: no such strategy, or see `StrategyOptions.train`.
    """
    options = strategy_named(strategy)
    networks = options.train(recording, options.recipe(recipe), seed, progress)
    return labeled(networks, options)


def strategy_of(
    networks: TrainedNetworks,
    run: RunOptions = RunOptions(),  # noqa: B008  # frozen
) -> Driver:
    """Build the strategy that networks belong to.

    Raises:
        StrategyError: the strategy does not support an option of the run.
    """
    kind = STRATEGIES.imported(networks.strategy)
    options = kind(**networks.strategy_options)
    run.check_supported(options.supports, f"strategy '{networks.strategy}'")
    return options.driver(networks.arm, networks.recipe, networks, run)
