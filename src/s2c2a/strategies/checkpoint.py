"""What strategy files share: safetensors with JSON beside the weights. Safe to open, whoever made them.

Only the weights and scalings of the networks are read from the arrays; what follows from the arm is built from its
description, so a file cannot make a controller speak other cables than its arm has.
"""

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import equinox as eqx
import jax
import numpy as np
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from s2c2a.arm import ArmSpec, arm_from_toml
from s2c2a.errors import S2C2AError, StrategyError
from s2c2a.files import written_whole

SCHEMA = 1
Options = TypeVar("Options")
Networks = TypeVar("Networks")


class Metadata(BaseModel):
    """What stands beside the weights."""

    model_config = ConfigDict(extra="forbid")

    schema_version: int
    version: str
    arm: str
    recipe: dict
    seed: int
    percent: dict[str, tuple[float, float]]

    def trained_for(self, path: str | os.PathLike, arm: ArmSpec | None) -> ArmSpec:
        """The arm that was trained for.

        Raises:
            StrategyError: damaged, or it differs from the arm that is given.
        """
        try:
            trained_for = arm_from_toml(self.arm, f"arm in {path}")
        except S2C2AError as error:
            raise StrategyError(f"{path} is damaged: {error}; train it anew") from error
        if arm is not None and not arm.same_body(trained_for):
            raise StrategyError(
                f"{path} was trained for '{trained_for.name}', which differs from '{arm.name}' in "
                f"{', '.join(arm.differences(trained_for))}; train one for this arm with `s2c2a train`"
            )
        return trained_for

    def recipe_as(self, form: type[Options], path: str | os.PathLike) -> Options:
        """How it was trained.

        Raises:
            StrategyError: damaged.
        """
        adapter = TypeAdapter(form)
        try:
            recipe = adapter.validate_python(self.recipe)
        except (S2C2AError, ValidationError) as error:
            raise StrategyError(f"{path} is damaged: {error}; train it anew") from error
        if not all_read(self.recipe, adapter.dump_python(recipe)):
            raise StrategyError(f"{path} is damaged: its recipe is of no known form; train it anew")
        return recipe


def write(path: str | os.PathLike, kind: str, arrays: dict[str, np.ndarray], metadata: Metadata) -> None:
    """Write a file; it appears whole or not at all. Its kind is the key of its metadata.

    Raises:
        StrategyError: the file cannot be written.
    """
    content = save(arrays, metadata={kind: metadata.model_dump_json()})
    try:
        with written_whole(path) as part:
            part.write_bytes(content)
    except OSError as error:
        raise StrategyError(f"{path} cannot be written: {error}; choose another place") from error


def read(path: str | os.PathLike, kind: str) -> tuple[dict[str, np.ndarray], Metadata]:
    """Arrays and metadata of a file.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema.
    """
    with _opened(path) as file:
        metadata = _metadata_in(file, kind, path)
        arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    return arrays, metadata


def read_metadata(path: str | os.PathLike, kind: str) -> Metadata:
    """The metadata alone, which is quicker.

    Raises:
        StrategyError: no such file, damaged, of another kind or schema.
    """
    with _opened(path) as file:
        return _metadata_in(file, kind, path)


@contextmanager
def _opened(path: str | os.PathLike) -> Iterator[Any]:
    """A file to read; whatever is wrong with it becomes a StrategyError."""
    if not Path(path).is_file():
        raise StrategyError(f"no strategy at {path}; train one with `s2c2a train`")
    try:
        with safe_open(path, framework="numpy") as file:
            yield file
    except (SafetensorError, OSError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise StrategyError(f"{path} is no strategy file, or damaged: {error}; train it anew") from error


def _metadata_in(file: Any, kind: str, path: str | os.PathLike) -> Metadata:
    metadata = Metadata.model_validate(json.loads((file.metadata() or {}).get(kind, "null")))
    if metadata.schema_version != SCHEMA:
        raise StrategyError(f"{path} has schema {metadata.schema_version}, this version reads {SCHEMA}; train it anew")
    return metadata


def learned(networks) -> dict[str, np.ndarray]:
    """Every array that is learned or fitted to data, by its place in the networks."""
    leaves = jax.tree_util.tree_leaves_with_path(networks)
    named = {jax.tree_util.keystr(path): leaf for path, leaf in leaves if eqx.is_array(leaf)}
    return {name: np.asarray(leaf) for name, leaf in named.items() if _is_learned(name)}


def filled(blank: Networks, arrays: dict[str, np.ndarray], path: str | os.PathLike) -> Networks:
    """The blank networks with the file's numbers.

    Raises:
        StrategyError: one is missing, not finite or of another shape.
    """

    def fill(place, leaf):
        name = jax.tree_util.keystr(place)
        if not _is_array(leaf) or not _is_learned(name):
            return leaf
        found = arrays.get(name)
        if found is None or found.shape != leaf.shape or found.dtype != np.float32 or not np.isfinite(found).all():
            raise StrategyError(
                f"{path} holds no sound array {name} of shape {leaf.shape}; it is damaged: train it anew"
            )
        return found

    full, rest = eqx.partition(jax.tree_util.tree_map_with_path(fill, blank), _is_array)
    return eqx.combine(jax.device_put(full), rest)  # all in one go: each alone would be a program of its own


def all_read(written, understood) -> bool:
    """Whether no key was passed over.

    Of several forms, one that knows some of the keys would else do for another.
    """
    if not isinstance(written, dict):
        return True
    return all(key in understood and all_read(value, understood[key]) for key, value in written.items())


def _is_learned(name: str) -> bool:
    """Whether an array is learned or fitted to data; the last layer and the body follow from the arm."""
    return "sum_and_range" not in name and ".body" not in name


def _is_array(leaf) -> bool:
    return isinstance(leaf, np.ndarray | jax.Array)
