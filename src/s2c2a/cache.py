"""Cache folder of recordings, networks and compiled programs; it is safe to delete."""

import os
from contextlib import suppress
from pathlib import Path

import platformdirs

MAX_PROGRAM_BYTES = 500_000_000


def cache_folder() -> Path:
    """Path of the cache folder; the environment variable `S2C2A_CACHE` overrides it."""
    return Path(os.environ.get("S2C2A_CACHE") or platformdirs.user_cache_dir("s2c2a"))


def enable_compilation_cache() -> None:
    """Enable JAX's persistent compilation cache, so that a second start is fast.

    JAX evicts the least recently used programs. Call this before the first import of
    JAX. It does nothing if the user has configured JAX's cache.
    """
    folder = cache_folder() / "programs"
    settings = {
        "JAX_COMPILATION_CACHE_DIR": folder,
        "JAX_COMPILATION_CACHE_MAX_SIZE": MAX_PROGRAM_BYTES,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": 0.05,
    }
    if any(name in os.environ for name in settings):
        return
    for name, value in settings.items():
        os.environ[name] = str(value)
    delete_incomplete_programs(folder)


def delete_incomplete_programs(folder: Path) -> None:
    """Delete cached programs without a time stamp, which a killed process leaves.

    JAX stores no new programs while such a file exists.
    """
    with suppress(OSError):
        for program in folder.glob("*-cache"):
            stamp = program.name.removesuffix("-cache") + "-atime"
            if not program.with_name(stamp).exists():
                program.unlink(missing_ok=True)
