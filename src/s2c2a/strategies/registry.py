"""Strategies by name."""

from dataclasses import asdict, replace

from s2c2a.components import Registry
from s2c2a.strategies.options import StrategyOptions
from s2c2a.strategies.pcc import FittedPCC, PlainPCC
from s2c2a.strategies.s2c2a import S2C2A, S2C2AMotor
from s2c2a.strategies.trained import TrainedNetworks

STRATEGIES: Registry[StrategyOptions] = Registry(
    "strategy",
    StrategyOptions,
    {kind.name: kind for kind in (S2C2A, PlainPCC, FittedPCC, S2C2AMotor)},
)
"""The paper's strategy and its comparisons without learning, for `--strategy`.

A clone has `lstm`, too (`experiments/`)."""


def labeled(networks: TrainedNetworks, options: StrategyOptions) -> TrainedNetworks:
    """Networks with the strategy that they belong to, as files keep it."""
    return replace(
        networks,
        strategy=STRATEGIES.name_of(type(options)),
        strategy_options=asdict(options),
    )
