"""Compiled programs on disk, so that a start neither traces nor compiles.

JAX's own cache knows a program by its text, which takes longer to write than the rest of
a start. Here a program is known by what the text follows from: the function, the shapes
of its inputs, the sources of this package, constants that a script has changed in them,
versions, compiler options and the processor. Only what follows from these is kept:
programs of custom code, and all programs while sources differ from what was imported, are
traced in every process.

A file holds code of the processor, and a pickle, as JAX makes it: files are read only if
they are the user's own, and nobody else can write them.
"""

import io
import math
import os
import pickle
import platform
import re
import sys
from contextlib import suppress
from functools import cache, reduce
from hashlib import blake2b
from pathlib import Path
from types import FunctionType
from typing import Any

import jax
import numpy as np
from jax._src import config as jax_config
from jax.experimental import serialize_executable
from pydantic import BaseModel

from s2c2a.errors import S2C2AError
from s2c2a.execution.cache import IMPORTED, cache_folder
from s2c2a.execution.sources import KNOWN
from s2c2a.execution.versions import PACKAGE, versions
from s2c2a.files.text import write_atomically

TRACED = re.compile(
    r"s2c2a\.(arm|control|estimation|execution\.compilation|goals|kinematics"
    r"|models|obstacles|paper|planning|spaces|training)\b"
)
"""Modules of whose functions and constants programs are made."""
HELPERS = "beartype", "jaxtyping", "lazy_loader", "pydantic", "pydantic_core", "scipy"
LIBRARIES = KNOWN.union(HELPERS, {PACKAGE.name})
"""Packages whose functions the sources or versions tell of."""
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
        text = described.getvalue() + _changes() + _environment()
    except Exception:  # custom code, or what objects raise that cannot be pickled
        return None
    return place / blake2b(text, digest_size=20).hexdigest()


class _Description(pickle.Pickler):
    """A text that equal objects share in all processes."""

    def persistent_id(self, value: Any) -> str | None:
        if hasattr(value, "__qualname__"):
            return _name_of(value)
        if isinstance(value, BaseModel):  # two may differ in the order of their fields
            return _name_of(type(value)) + repr(value)
        return None


def load(place: Path | None, inputs: tuple) -> tuple[Any, Any] | None:
    """The program and its result for these inputs, if it is kept and runs here."""
    if place is None or not place.exists():
        return None
    _find_lapack()
    try:
        saved = pickle.loads(_own_content(place))
        program = serialize_executable.deserialize_and_load(*saved)
        return program, jax.block_until_ready(program(*inputs))
    except Exception:  # a damaged or foreign file, or one of another machine
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
        options: of XLA.
    """
    if place is None:
        return _compiled(lowered, options)
    # a program out of JAX's cache cannot be kept a second time: this option, which changes
    # nothing, keeps it out of there
    with jax_config.persistent_cache_min_compile_time_secs(math.inf):
        program = _compiled(lowered, options | {"xla_embed_ir_in_executable": False})
    with suppress(OSError, S2C2AError, ValueError, NotImplementedError):
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        content = pickle.dumps(serialize_executable.serialize(program))
        write_atomically(blake2b(content).digest() + content, place)
        place.chmod(0o600)
    return program


def _compiled(lowered: jax.stages.Lowered, options: Any) -> jax.stages.Compiled:
    try:
        return lowered.compile(options)
    except jax.errors.JaxRuntimeError:  # of a version that does not know the options
        return lowered.compile()


def _own_content(path: Path) -> bytes:
    """Contents of a file that belongs to the user, and that nobody else can write.

    Raises:
        OSError: it is another one, a link, or damaged: its code could end the process.
    """
    with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW), "rb") as file:
        status = os.fstat(file.fileno())
        digest, content = file.read(blake2b().digest_size), file.read()
    others_may_write = status.st_mode & 0o022
    is_own = status.st_uid == os.getuid() and not others_may_write
    if not is_own or blake2b(content).digest() != digest:
        raise PermissionError(path)
    return content


def _environment() -> bytes:
    """What programs follow from beside their description.

    Raises:
        LookupError: sources were changed since the package was imported.
    """
    files = sorted(PACKAGE.rglob("[!.]*.py"))
    if any(file.stat().st_ctime > IMPORTED for file in files):
        raise LookupError("the sources are no longer those of this process")
    settings = CONFIG.jax_enable_x64, CONFIG.jax_default_matmul_precision
    variables = [os.environ.get(name) for name in VARIABLES]
    return _machine(tuple(files)) + f"{settings} {variables}".encode()


@cache
def _machine(files: tuple[Path, ...]) -> bytes:
    """Digest of the sources, versions and processor."""
    sources = b"".join(map(Path.read_bytes, files))
    kinds = {platform.machine(), platform.processor()}
    kinds |= {f"{device} {device.device_kind}" for device in jax.devices()}
    if PROCESSOR.exists():
        lines = PROCESSOR.read_text("utf-8").splitlines()
        # of Intel and AMD, and of ARM
        kinds |= {line for line in lines if re.match("flags|model|Features|CPU ", line)}
    told = versions() | {"sources": ""}  # those of the program count by themselves
    return blake2b(sources).digest() + repr([told, sorted(kinds)]).encode()


def _changes() -> bytes:
    """What a script can have changed in traced modules: constants and functions.

    Raises:
        LookupError: a function of custom code stands there.
    """
    rows = []
    for name in filter(TRACED.match, tuple(sys.modules)):
        members = dict(vars(sys.modules[name]))
        classes = [kind for kind in members.values() if isinstance(kind, type)]
        for holder in (members, *map(dict, map(vars, classes))):
            told = {key: _told(key, value) for key, value in holder.items()}
            rows.append(f"{name} {sorted(told.items())}")
    return repr(sorted(rows)).encode()


def _told(key: str, value: Any) -> str:
    """Which constant or function it is; others come and go with caches."""
    function = getattr(value, "__func__", value)
    function = function.fget if isinstance(function, property) else function
    if isinstance(function, FunctionType):
        _check_known(function.__module__)
        return f"{function.__module__} {function.__code__.co_firstlineno}"
    if isinstance(value, np.ndarray):
        return f"{value.shape} {value.tobytes()!r}"
    is_constant = key.isupper() and not isinstance(value, set | frozenset)
    text = repr(value) if is_constant else type(value).__name__
    return re.sub(" at 0x[0-9a-f]+", "", text)


def _name_of(value: Any) -> str:
    """Name of a function or class, under which its module has it.

    A lambda has no name, but a line.

    Raises:
        LookupError: it is custom code, or one of several of that name.
    """
    _check_known(value.__module__)
    name = f"{value.__module__}.{value.__qualname__}"
    if value.__module__ == "builtins":
        return name
    if name.endswith("<lambda>") and not (value.__closure__ or value.__defaults__):
        return f"{name} {value.__code__.co_firstlineno} {value.__code__.co_code!r}"
    path = value.__qualname__.split(".")
    if reduce(getattr, path, sys.modules[value.__module__]) is not value:
        raise LookupError(name)
    return name


def _check_known(module: str) -> None:
    if module.partition(".")[0] not in LIBRARIES and "namedtuple_" not in module:
        raise LookupError(f"{module} is custom code")
