"""Files of trained networks: what they hold. `checkpoint` defines their form."""

import os
from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from pydantic import TypeAdapter

import s2c2a
from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.errors import S2C2AError, StrategyError, listed
from s2c2a.estimation import MODAL_MODEL, EncoderOnly
from s2c2a.estimation.sensor_models import PREFIX
from s2c2a.files.text import check_replaceable
from s2c2a.models.session import SessionC2S
from s2c2a.plugins.components import Registry
from s2c2a.strategies.checkpoint import (
    SCHEMA,
    Arrays,
    Metadata,
    damaged,
    filled,
    learned,
    read,
    write,
)
from s2c2a.strategies.recipe import recipe_in
from s2c2a.strategies.registry import STRATEGIES
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import Trained
from s2c2a.training.fit import parameters

ENDING = ".safetensors"
OPTIONAL = (MODAL_MODEL, PREFIX)
"""Beginnings of the names of networks that a file may lack."""
CURVE = "curve."
SPREAD = "spread"
"""Beginning of the names of arrays that only a prior has."""


def check_new_networks(path: str | os.PathLike, overwrite: bool) -> None:
    """Refuse an impossible place of a weight file before the long work; make its folder.

    Raises:
        StrategyError: the file exists and is not to be replaced, or is of another kind.
    """
    check_replaceable(path, ENDING, StrategyError, overwrite)
    Path(path).parent.mkdir(parents=True, exist_ok=True)


def save_networks(networks: TrainedNetworks, path: str | os.PathLike) -> None:
    """Write trained networks; the file appears whole or not at all.

    Raises:
        S2C2AError: the file cannot be written, or the networks have a session.
    """
    if isinstance(networks.networks.get("C2S"), SessionC2S):
        raise StrategyError(
            "these networks have a session, which is a file of its own; save those of "
            "load_networks"
        )
    metadata = Metadata(
        schema_version=SCHEMA,
        version=s2c2a.__version__,
        strategy=networks.strategy,
        strategy_options=dict(networks.strategy_options),
        arm=arm_to_toml(networks.arm),
        recipe=asdict(networks.recipe.by_class),
        seed=networks.seed,
        percent={name: result.percent for name, result in networks.trained.items()},
        errors={
            name: result.errors
            for name, result in networks.trained.items()
            if result.errors
        },
    )
    arrays = learned(networks.networks)
    if networks.is_prior:
        arrays |= learned({SPREAD: networks.trained["C2S"].spread})
    for name, result in networks.trained.items():
        arrays[f"{CURVE}{name}"] = np.asarray(result.curve)
    write(path, metadata, arrays)


def load_networks(
    path: str | os.PathLike, arm: ArmSpec | None = None
) -> TrainedNetworks:
    """Read trained networks, for an arm if one is given.

    Classes of the user's own that the file names must be imported before
    (`Registry.named`); the file itself runs no code.

    Raises:
        StrategyError: no such file, damaged, of another schema, or trained for another
            arm.
    """
    metadata, arrays = read(path)
    trained_for = _arm(metadata, path)
    if arm is not None and arm.differences(trained_for):
        raise StrategyError(
            f"{path} was trained for '{trained_for.name}', which differs from "
            f"'{arm.name}' in {listed(trained_for.differences(arm))}; give the arm of the "
            "file, or train one for this arm with `s2c2a train`"
        )
    with damaged(path):
        # the file is of unknown origin: its recipe imports nothing
        recipe = recipe_in(metadata.recipe, Registry.imported)
        try:
            _ = recipe.estimator_options
        except S2C2AError:  # the user's own: a recipe file has to name it again
            recipe = replace(recipe, estimator=EncoderOnly())
        kind = STRATEGIES.imported(metadata.strategy)
        strategy = TypeAdapter(kind).validate_python(metadata.strategy_options)
        # shapes of the networks that the file holds
        shapes = eqx.filter_eval_shape(
            lambda seed: strategy.untrained(trained_for, recipe, jax.random.key(seed)),
            0,
        )
        blanks = {
            name: shape
            for name, shape in shapes.items()
            if name in metadata.percent or not name.startswith(OPTIONAL)
        }
        networks = filled(blanks, trained_for, arrays)
        spread = _spread(blanks, trained_for, arrays)
        curves = {
            name.removeprefix(CURVE): _curve(name, values)
            for name, values in arrays.items()
            if name.startswith(CURVE)
        }
        if not set(networks) == set(curves) == set(metadata.percent):
            raise StrategyError("networks, curves and errors differ in their names")
    trained = {
        name: Trained(
            networks[name],
            curves[name],
            percent,
            metadata.errors.get(name, {}),
            spread if name == "C2S" else None,
        )
        for name, percent in metadata.percent.items()
    }
    return TrainedNetworks(
        arm or trained_for,
        recipe,
        metadata.seed,
        trained,
        metadata.strategy,
        metadata.strategy_options,
    )


def stated_errors(path: str | os.PathLike) -> tuple[ArmSpec, Mapping[str, Any]]:
    """The arm that networks were trained for, and their errors (`Trained.percent`).

    Raises:
        StrategyError: no such file, damaged, or of another schema.
    """
    metadata, _ = read(path)
    return _arm(metadata, path), metadata.percent


def _arm(metadata: Metadata, path: str | os.PathLike) -> ArmSpec:
    with damaged(path):
        return arm_from_toml(metadata.arm, f"arm in {path}")


def _spread(blanks: Mapping[str, Any], arm: ArmSpec, arrays: Arrays) -> Any:
    """Spread of the parameters over arms; None unless the file holds a prior."""
    if not any(name.startswith(SPREAD) for name in arrays):
        return None
    model = blanks["C2S"]
    spread = filled({SPREAD: getattr(model, "chain", model)}, arm, arrays)[SPREAD]
    positive = [bool((leaf > 0).all()) for leaf in parameters(spread)]
    if not all(positive):
        raise StrategyError("the spread of a parameter is not positive")
    return spread


def _curve(name: str, curve: np.ndarray) -> np.ndarray:
    if curve.ndim != 2 or curve.shape[1] != 3 or not np.isfinite(curve).all():
        raise StrategyError(
            f"the curve of {name.removeprefix(CURVE)} has no rows of epoch, training and "
            "validation loss"
        )
    return curve
