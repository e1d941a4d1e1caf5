"""Format of files of trained networks: safetensors with JSON metadata, safe to open.

Only what was learned or fitted to data is read from the arrays; what follows from the
arm is built from its description, so a file cannot make a controller command other
cables than its arm has. A digest of the whole file detects damage; sizes and numbers are
limited, since a digest does not show who made the file.
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from hashlib import blake2b
from pathlib import Path
from typing import Annotated, Any

import equinox as eqx
import jax
import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from safetensors import SafetensorError
from safetensors.numpy import load, save

from s2c2a.arm import ArmSpec
from s2c2a.episodes.blocks import WORD
from s2c2a.errors import S2C2AError, StrategyError, UntrustedCodeError, did_you_mean
from s2c2a.files.text import LARGEST, MAX_BYTES, MAX_TEXT, write_atomically
from s2c2a.training import FromArm

SHIPPED = "shipped"
"""Name of the networks of the package in place of a file."""
SCHEMA = 7  # of the format; another number is another format
METADATA = "s2c2a"
DIGEST = "digest"
NO_DIGEST = "0" * 64  # as long as a digest of 32 bytes, in hexadecimal digits

_FOREIGN = (
    SafetensorError,
    ValueError,
    TypeError,
    KeyError,
    AttributeError,
    RecursionError,
)
Arrays = Mapping[str, np.ndarray]


class Metadata(BaseModel):
    """Metadata beside the weights."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    schema_version: int
    version: str
    strategy: str
    strategy_options: dict
    arm: str
    recipe: dict
    seed: Annotated[int, Field(ge=-(2**63), lt=2**63)]
    percent: Mapping[str, tuple[float, float]]
    errors: Mapping[str, Mapping[str, float]] = {}


def write(path: str | os.PathLike, metadata: Metadata, arrays: Arrays) -> None:
    """Write a file; it appears whole or not at all.

    Raises:
        S2C2AError: the file cannot be written.
    """
    texts = {METADATA: metadata.model_dump_json(), DIGEST: NO_DIGEST}
    content = save(dict(arrays), metadata=texts)
    # sorted metadata, so that equal networks make equal files
    end = 8 + _header_bytes(content)
    header = json.loads(content[8:end])
    header["__metadata__"] = dict(sorted(texts.items()))
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    padded = text + b" " * (-len(text) % 8)
    content = len(padded).to_bytes(8, "little") + padded + content[end:]
    write_atomically(
        content.replace(NO_DIGEST.encode(), _digest(content).encode(), 1), path
    )


def read(path: str | os.PathLike) -> tuple[Metadata, Arrays]:
    """Read metadata and arrays.

    Raises:
        StrategyError: no such file, too large, damaged, or of another schema.
    """
    content = _content(path)
    with damaged(path):
        header = json.loads(content[8 : 8 + _header_bytes(content)])
        texts = header.get("__metadata__") or {}
        table = json.loads(texts.get(METADATA, "null"))
        schema = table["schema_version"]
    if schema != SCHEMA:
        raise StrategyError(
            f"{path} has schema {schema}, and this version reads {SCHEMA}: another "
            "version wrote it; make it again with `s2c2a collect` and `s2c2a train`"
        )
    with damaged(path):
        digest = texts[DIGEST]
        metadata = Metadata.model_validate(table)
        blank = content.replace(digest.encode(), NO_DIGEST.encode(), 1)
        if digest != _digest(blank):
            raise StrategyError("its digest does not match its content")
        return metadata, load(content)


@contextmanager
def damaged(path: str | os.PathLike) -> Iterator[None]:
    """Whatever is wrong with a file's content becomes a StrategyError."""
    try:
        yield
    except UntrustedCodeError as error:
        raise UntrustedCodeError(f"{path}: {error}") from error
    except (*_FOREIGN, S2C2AError) as error:
        raise StrategyError(
            f"{path} is no strategy file, or damaged: {error}; train it anew"
        ) from error


def _content(path: str | os.PathLike) -> bytes:
    """All of a file, unless it is too large."""
    if not Path(path).is_file():
        if str(path) == SHIPPED:
            raise StrategyError(
                "a file is needed, and 'shipped' stands for the networks of the package; "
                "train your own with `s2c2a train`"
            )
        likely = did_you_mean(str(path), [SHIPPED])
        raise StrategyError(
            f"no strategy at {path}{likely}; train one with `s2c2a train`"
        )
    try:
        with open(path, "rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise StrategyError(f"{path} cannot be read: {error}") from error
    if len(content) > MAX_BYTES:
        raise StrategyError(
            f"{path} is larger than {MAX_BYTES / 1e6:.0f} MB and no strategy file; choose another"
        )
    if content.startswith(WORD):
        raise StrategyError(
            f"{path} is a recording or a run, not networks; train networks on a "
            "recording with `s2c2a train`"
        )
    return content


def _header_bytes(content: bytes) -> int:
    count = int.from_bytes(content[:8], "little")
    if count > MAX_TEXT:
        raise StrategyError(f"its header has {count} bytes, more than {MAX_TEXT}")
    return count


def _digest(content: bytes) -> str:
    return blake2b(content, digest_size=len(NO_DIGEST) // 2).hexdigest()


def learned(networks: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Every array but those that follow from the arm, by network and place in it."""
    return {
        f"{name}{jax.tree_util.keystr(place)}": np.asarray(leaf)
        for name, network in networks.items()
        for place, leaf in jax.tree_util.tree_leaves_with_path(
            network, is_leaf=_is_from_arm
        )
        if _is_array(leaf)
    }


def filled(blanks: Mapping[str, Any], arm: ArmSpec, arrays: Arrays) -> dict[str, Any]:
    """Networks of these shapes with a file's numbers.

    Args:
        blanks: networks of shapes alone (`eqx.filter_eval_shape`), so that none grows
            as large as a file says.
        arm: from which the rest follows.
        arrays: of the file.

    Raises:
        StrategyError: one is missing, not sound or of another shape.
    """

    def fill(network: str, place, blank):
        if _is_from_arm(blank):
            return type(blank).of(arm)
        if not _is_array(blank):
            return blank
        name = f"{network}{jax.tree_util.keystr(place)}"
        found = arrays.get(name)
        if (
            found is not None
            and (found.shape, found.dtype) == (blank.shape, blank.dtype)
            # false for NaN
            and bool(((found >= -LARGEST) & (found <= LARGEST)).all())
        ):
            return found
        raise StrategyError(
            f"it holds no sound array {name} of shape {blank.shape}, all within "
            f"{LARGEST:g}"
        )

    full = {
        name: jax.tree_util.tree_map_with_path(
            partial(fill, name), blank, is_leaf=_is_from_arm
        )
        for name, blank in blanks.items()
    }
    numbers, rest = eqx.partition(full, _is_array)
    # all in one go, which is quicker than each alone
    return eqx.combine(jax.device_put(numbers), rest)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, np.ndarray | jax.Array | jax.ShapeDtypeStruct)


def _is_from_arm(part: Any) -> bool:
    return isinstance(part, FromArm)
