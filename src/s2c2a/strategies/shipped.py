"""Trained networks that come with the package: both presets, recipe `best`, seed 0; docs/live.md says how to make them.

A file holds what was learned; how plans are made with it is the recipe's as it is today.
"""

from dataclasses import replace
from importlib import resources

from s2c2a.arm import ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.strategies.files import arm_of_strategy, load_strategy
from s2c2a.strategies.recipe import recipe_named
from s2c2a.strategies.s2c2a import TrainedNetworks

FOLDER = resources.files("s2c2a.strategies").joinpath("weights")


def shipped_networks(arm: ArmSpec) -> TrainedNetworks:
    """The networks that the package brings for an arm.

    Raises:
        StrategyError: it brings none for this arm.
    """
    for file in sorted(FOLDER.iterdir(), key=lambda one: one.name):
        if file.name.endswith(".safetensors"):
            with resources.as_file(file) as path:
                if arm_of_strategy(path).same_body(arm):
                    networks = load_strategy(path)
                    return replace(networks, arm=arm, recipe=recipe_named(networks.recipe.name))
    raise StrategyError(
        f"no trained networks come with the package for '{arm.name}'; collect data with `s2c2a collect`, train with "
        "`s2c2a train`, and give the file with --weights"
    )
