"""Files of the paper's strategy: both networks, their recipe and their arm; see `checkpoint` for the form."""

import os
from dataclasses import asdict

import numpy as np

import s2c2a
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.strategies.checkpoint import SCHEMA, Metadata, filled, learned, read, read_metadata, write
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.s2c2a import TrainedNetworks, blank_networks

KIND = "s2c2a"


def save_strategy(networks: TrainedNetworks, path: str | os.PathLike) -> None:
    """Write trained networks; the file appears whole or not at all.

    Raises:
        StrategyError: the file cannot be written.
    """
    curves = {f"curve.{name}": np.asarray(curve) for name, curve in networks.curves.items()}
    metadata = Metadata(
        schema_version=SCHEMA,
        version=s2c2a.__version__,
        arm=arm_to_toml(networks.arm),
        recipe=asdict(networks.recipe),
        seed=networks.seed,
        percent=networks.percent,
    )
    write(path, KIND, learned((networks.c2s, networks.c2a)) | curves, metadata)


def arm_of_strategy(path: str | os.PathLike) -> ArmSpec:
    """The arm that a strategy was trained for.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema.
    """
    return read_metadata(path, KIND).trained_for(path, None)


def load_strategy(path: str | os.PathLike, arm: ArmSpec | None = None) -> TrainedNetworks:
    """Read trained networks, for an arm if one is given.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema, or trained for another arm.
    """
    arrays, metadata = read(path, KIND)
    trained_for, recipe = metadata.trained_for(path, arm), metadata.recipe_as(Recipe, path)
    c2s, c2a = filled(blank_networks(trained_for, recipe), arrays, path)
    curves = {name.removeprefix("curve."): value for name, value in arrays.items() if name.startswith("curve.")}
    return TrainedNetworks(trained_for, recipe, metadata.seed, c2s, c2a, metadata.percent, curves)
