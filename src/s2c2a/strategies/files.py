"""Strategy files: safetensors with JSON beside the weights. Safe to open, whoever made them.

Only the weights and scalings of the networks are read from the arrays; what follows from the arm is built from its
description, so a file cannot make a controller speak other cables than its arm has.
"""

import json
import os
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

import s2c2a
from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.networks import C2A, C2S
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.s2c2a import TrainedNetworks

SCHEMA = 1


class _Metadata(BaseModel):
    """What stands beside the weights."""

    model_config = ConfigDict(extra="forbid")

    schema_version: int
    version: str
    arm: str
    recipe: dict
    seed: int
    percent: dict[str, tuple[float, float]]


def save_strategy(networks: TrainedNetworks, path: str | os.PathLike) -> None:
    """Write trained networks; the file appears whole or not at all.

    Raises:
        StrategyError: the file cannot be written.
    """
    arrays = {name: np.asarray(value) for name, value in _learned(networks.c2s, networks.c2a).items()}
    arrays |= {f"curve.{name}": np.asarray(curve) for name, curve in networks.curves.items()}
    metadata = _Metadata(
        schema_version=SCHEMA,
        version=s2c2a.__version__,
        arm=arm_to_toml(networks.arm),
        recipe=asdict(networks.recipe),
        seed=networks.seed,
        percent=networks.percent,
    )
    partial = Path(f"{path}.{os.getpid()}.partial")
    try:
        partial.parent.mkdir(parents=True, exist_ok=True)
        save_file(arrays, partial, metadata={"s2c2a": metadata.model_dump_json()})
        os.replace(partial, path)
    except (OSError, SafetensorError) as error:
        with suppress(OSError):
            partial.unlink()
        raise StrategyError(f"{path} cannot be written: {error}; choose another place") from error


def load_strategy(path: str | os.PathLike, arm: ArmSpec | None = None) -> TrainedNetworks:
    """Read trained networks, for an arm if one is given.

    Raises:
        StrategyError: no such file, damaged, of another schema, or trained for another arm.
    """
    arrays, metadata = _read(path)
    try:
        trained_for = arm_from_toml(metadata.arm, f"arm in {path}")
        recipe = TypeAdapter(Recipe).validate_python(metadata.recipe)
    except (S2C2AError, ValidationError) as error:
        raise StrategyError(f"{path} is damaged: {error}; train it anew") from error
    if arm is not None and not arm.same_body(trained_for):
        raise StrategyError(
            f"{path} was trained for '{trained_for.name}', which differs from '{arm.name}' in "
            f"{', '.join(arm.differences(trained_for))}; train one for this arm with `s2c2a train`"
        )
    key = jax.random.key(0)
    blank = C2S.untrained(**asdict(recipe.c2s), key=key), C2A.untrained(trained_for, **asdict(recipe.c2a), key=key)
    c2s, c2a = _filled(blank, arrays, path)
    curves = {name.removeprefix("curve."): value for name, value in arrays.items() if name.startswith("curve.")}
    return TrainedNetworks(trained_for, recipe, metadata.seed, c2s, c2a, metadata.percent, curves)


def _is_learned(name: str) -> bool:
    """Whether an array is learned or fitted to data; the last layer follows from the arm."""
    return "sum_and_range" not in name


def _learned(c2s: C2S, c2a: C2A) -> dict[str, jax.Array]:
    leaves = jax.tree_util.tree_leaves_with_path((c2s, c2a))
    named = {jax.tree_util.keystr(path): leaf for path, leaf in leaves if eqx.is_array(leaf)}
    return {name: leaf for name, leaf in named.items() if _is_learned(name)}


def _read(path: str | os.PathLike) -> tuple[dict[str, np.ndarray], _Metadata]:
    if not Path(path).is_file():
        raise StrategyError(f"no strategy at {path}; train one with `s2c2a train`")
    try:
        with safe_open(path, framework="numpy") as file:
            metadata = _Metadata.model_validate(json.loads((file.metadata() or {}).get("s2c2a", "null")))
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except (SafetensorError, OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise StrategyError(f"{path} is no strategy file, or damaged: {error}; train it anew") from error
    if metadata.schema_version != SCHEMA:
        raise StrategyError(f"{path} has schema {metadata.schema_version}, this version reads {SCHEMA}; train it anew")
    return arrays, metadata


def _filled(blank: tuple[C2S, C2A], arrays: dict[str, np.ndarray], path) -> tuple[C2S, C2A]:
    """The blank networks with the file's numbers, refused where one is missing, not finite or of another shape."""

    def fill(place, leaf):
        name = jax.tree_util.keystr(place)
        if not eqx.is_array(leaf) or not _is_learned(name):
            return leaf
        found = arrays.get(name)
        if found is None or found.shape != leaf.shape or found.dtype != np.float32 or not np.isfinite(found).all():
            raise StrategyError(
                f"{path} holds no sound array {name} of shape {leaf.shape}; it is damaged: train it anew"
            )
        return jnp.asarray(found)

    return jax.tree_util.tree_map_with_path(fill, blank)
