"""Strategy files: safetensors with JSON beside the weights. Safe to open, whoever made them."""

import json
import os
from dataclasses import asdict
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

import s2c2a
from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.errors import StrategyError
from s2c2a.networks import C2A, C2S
from s2c2a.strategies.recipe import recipe_named
from s2c2a.strategies.s2c2a import TrainedNetworks

SCHEMA = 1


def save_strategy(networks: TrainedNetworks, path: str | os.PathLike) -> None:
    """Write trained networks; the file appears whole or not at all."""
    arrays = {name: np.asarray(value) for name, value in _named_arrays(networks.c2s, networks.c2a).items()}
    arrays |= {f"curve.{name}": curve for name, curve in networks.curves.items()}
    metadata = {
        "schema": SCHEMA,
        "version": s2c2a.__version__,
        "arm": arm_to_toml(networks.arm),
        "recipe": networks.recipe,
        "options": asdict(recipe_named(networks.recipe)),
        "seed": networks.seed,
        "percent": networks.percent,
    }
    partial = Path(f"{path}.partial")
    partial.parent.mkdir(parents=True, exist_ok=True)
    save_file(arrays, partial, metadata={"s2c2a": json.dumps(metadata)})
    os.replace(partial, path)


def load_strategy(path: str | os.PathLike, arm: ArmSpec | None = None) -> TrainedNetworks:
    """Read trained networks, for an arm if one is given.

    Raises:
        StrategyError: no such file, damaged, of another schema or recipe, or trained for another arm.
    """
    arrays, metadata = _read(path)
    trained_for = arm_from_toml(metadata["arm"], f"arm in {path}")
    if arm is not None and _body(arm) != _body(trained_for):
        raise StrategyError(
            f"{path} was trained for '{trained_for.name}', which differs from '{arm.name}' in "
            f"{', '.join(_differences(arm, trained_for))}; train one for this arm with `s2c2a train`"
        )
    recipe = recipe_named(metadata["recipe"])
    key = jax.random.key(0)
    blank = C2S.untrained(**asdict(recipe.c2s), key=key), C2A.untrained(trained_for, **asdict(recipe.c2a), key=key)
    c2s, c2a = _filled(blank, arrays, path)
    curves = {name.removeprefix("curve."): value for name, value in arrays.items() if name.startswith("curve.")}
    percent = {name: tuple(values) for name, values in metadata["percent"].items()}
    return TrainedNetworks(trained_for, recipe.name, metadata["seed"], c2s, c2a, percent, curves)


def _named_arrays(c2s: C2S, c2a: C2A) -> dict[str, jax.Array]:
    leaves = jax.tree_util.tree_leaves_with_path((c2s, c2a))
    return {jax.tree_util.keystr(path): leaf for path, leaf in leaves if eqx.is_array(leaf)}


def _read(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], dict]:
    if not Path(path).is_file():
        raise StrategyError(f"no strategy at {path}; train one with `s2c2a train`")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = json.loads((file.metadata() or {}).get("s2c2a", "{}"))
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (SafetensorError, OSError, ValueError) as error:
        raise StrategyError(f"{path} is no strategy file, or damaged: {error}; train it anew") from error
    if metadata.get("schema") != SCHEMA:
        raise StrategyError(f"{path} has schema {metadata.get('schema')}, this version reads {SCHEMA}; train it anew")
    return arrays, metadata


def _filled(blank, arrays: dict[str, np.ndarray], path):
    """The blank networks with the file's numbers, refused where a shape differs."""

    def fill(place, leaf):
        name = jax.tree_util.keystr(place)
        if not eqx.is_array(leaf):
            return leaf
        if name not in arrays or arrays[name].shape != leaf.shape:
            raise StrategyError(f"{path} holds no array {name} of shape {leaf.shape}; it is damaged: train it anew")
        return jnp.asarray(arrays[name])

    return jax.tree_util.tree_map_with_path(fill, blank)


def _body(arm: ArmSpec) -> dict:
    """What matters of an arm: all but its name and description."""
    return arm.model_dump(exclude={"name", "description"})


def _differences(arm: ArmSpec, other: ArmSpec) -> list[str]:
    one, two = _body(arm), _body(other)
    return [key for key in one if one[key] != two[key]]
