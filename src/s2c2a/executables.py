"""Compiled programs on disk, so that a start neither traces nor compiles.

JAX's own cache knows a program by its text, which takes longer to write than the rest of
a start. Here a program is known by what the text follows from: the function, the shapes
of its inputs, the sources of this package, what a script has changed in them, versions,
compiler options and the processor. What is not known so well, such as custom code, is
traced in every process.

A file holds code of the processor, and a pickle, as JAX makes it: files are opened only
if they and their folder are the user's own, and nobody else can write there.
"""

import io
import math
import os
import pickle
import platform
import re
import stat
import sys
from contextlib import suppress
from functools import cache
from hashlib import blake2b
from pathlib import Path
from types import FunctionType
from typing import Any

import jax
import numpy as np
from jax._src import config as jax_config
from jax.experimental import serialize_executable
from pydantic import BaseModel

from s2c2a.cache import cache_folder
from s2c2a.errors import S2C2AError
from s2c2a.files import write_atomically
from s2c2a.versions import versions

PACKAGE = Path(__file__).parent
TRACED = re.compile(
    r"s2c2a\.(arm|backlash|compilation|control|estimation|goals|kinematics"
    r"|models|obstacles|paper|planning|spaces)\b"
)
"""Modules of whose functions and constants programs are made."""
QUICKLY = {"xla_cpu_use_fusion_emitters": False}
"""Options of XLA that halve the time of compilation of `best`; its steps are as fast.
Networks of the paper's kind compile no faster, and their plans take a tenth longer."""
OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
PROCESSOR = Path("/proc/cpuinfo")
CONFIG: Any = jax.config  # its attributes are made when JAX is imported
VARIABLES = ("XLA_FLAGS", "PJRT_NPROC", "NPROC", "JAX_PLATFORMS")


def place_of(*parts: Any) -> Path | None:
    """File of a program that follows from these.

    None if they cannot be pickled, or the user has another cache of JAX, or none.
    """
    place = cache_folder().absolute() / "executables"
    is_ours = CONFIG.jax_compilation_cache_dir == str(place.with_name("programs"))
    if not (is_ours and CONFIG.jax_enable_compilation_cache and hasattr(os, "getuid")):
        return None
    described = io.BytesIO()
    description = _Description(described)
    description.fast = True  # not whether equal parts are one object
    try:
        description.dump(parts)
    except Exception:  # pickle raises what objects raise
        return None
    text = described.getvalue() + _changes() + _environment()
    return place / blake2b(text, digest_size=20).hexdigest()


class _Description(pickle.Pickler):
    """A text that equal objects share in all processes."""

    def reducer_override(self, value: Any) -> Any:
        if isinstance(value, FunctionType | type):
            return sys.intern, (f"{value.__module__}.{value.__qualname__}",)
        if isinstance(value, BaseModel):  # it knows, in any order, what was given
            return sys.intern, (repr(value),)
        return NotImplemented


def load(place: Path | None, inputs: tuple) -> tuple[Any, Any] | None:
    """The program and its result for these inputs, if it is kept and runs here."""
    if place is None or not (_is_own(place.parent) and _is_own(place)):
        return None
    _find_lapack()
    try:
        saved = pickle.loads(place.read_bytes())
        program = serialize_executable.deserialize_and_load(*saved)
        return program, jax.block_until_ready(program(*inputs))
    except Exception:  # a damaged file, or one of another machine
        with suppress(OSError):
            place.unlink()
        return None


@cache
def _find_lapack() -> None:
    """Let JAX find LAPACK, as it does when a program that solves is lowered."""
    jax.jit(jax.numpy.linalg.solve).lower(np.eye(1), np.ones(1))


def made(place: Path | None, lowered: jax.stages.Lowered, options: Any) -> Any:
    """The program, compiled and kept, unless it or the folder cannot be written.

    Args:
        place: file of the program, if it is to be kept.
        lowered: the program.
        options: of XLA (`QUICKLY`), or None.
    """
    if place is None:
        return _compiled(lowered, options)
    # a program out of JAX's cache cannot be kept a second time
    with jax_config.persistent_cache_min_compile_time_secs(math.inf):
        program = _compiled(lowered, options)
    with suppress(OSError, S2C2AError, ValueError, NotImplementedError):
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if _is_own(place.parent):
            write_atomically(
                pickle.dumps(serialize_executable.serialize(program)), place
            )
            place.chmod(0o600)
    return program


def _compiled(lowered: jax.stages.Lowered, options: Any) -> jax.stages.Compiled:
    try:
        return lowered.compile(options)
    except jax.errors.JaxRuntimeError:  # of a version that does not know the options
        return lowered.compile()


def _is_own(path: Path) -> bool:
    """Whether it belongs to the user, and nobody else can write there."""
    try:
        status = path.stat()
    except OSError:
        return False
    return status.st_uid == os.getuid() and not status.st_mode & OTHERS_MAY_WRITE


@cache
def _environment() -> bytes:
    """What programs follow from beside their description."""
    sources = blake2b()
    for file in sorted(PACKAGE.rglob("*.py")):
        sources.update(file.read_bytes())
    processor = {platform.processor()}
    if PROCESSOR.exists():
        lines = PROCESSOR.read_text("utf-8").splitlines()
        processor |= {line for line in lines if line.startswith(("flags", "model"))}
    settings: list[Any] = [versions(), sorted(processor), jax.devices()]
    settings += [CONFIG.jax_enable_x64, CONFIG.jax_default_matmul_precision]
    settings += [os.environ.get(name) for name in VARIABLES]
    return sources.digest() + repr(settings).encode()


def _changes() -> bytes:
    """What a script can have changed in traced modules: constants and functions."""
    rows = []
    for name, module in list(sys.modules.items()):
        if not TRACED.match(name):
            continue
        kinds = [kind for kind in vars(module).values() if isinstance(kind, type)]
        for holder in (vars(module), *map(vars, kinds)):
            told = {key: _told(value) for key, value in holder.items()}
            rows.append(f"{name} {sorted(told.items())}")
    return repr(sorted(rows)).encode()


def _told(value: Any) -> str:
    """Which constant or function it is; others come and go with caches."""
    function = getattr(value, "__func__", value)
    if isinstance(function, FunctionType):
        return f"{function.__module__} {function.__code__.co_firstlineno}"
    if isinstance(value, bool | int | float | tuple | np.ndarray):
        return re.sub(" at 0x[0-9a-f]+", "", repr(value))
    return type(value).__name__
