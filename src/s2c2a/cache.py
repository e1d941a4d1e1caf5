"""Cache folder of recordings, networks and compiled programs; it is safe to delete."""

import os
import sys
from contextlib import suppress
from pathlib import Path

import platformdirs

MAX_PROGRAM_BYTES = 500_000_000  # bytes on the user's disk; JAX evicts older programs


def cache_folder() -> Path:
    """Path of the cache folder; the environment variable `S2C2A_CACHE` overrides it."""
    return Path(os.environ.get("S2C2A_CACHE") or platformdirs.user_cache_dir("s2c2a"))


def enable_compilation_cache() -> None:
    """Enable JAX's persistent compilation cache, so that a second start is fast.

    JAX evicts the least recently used programs. `import s2c2a` calls this. It does
    nothing if the user has configured JAX's cache, by environment variables or before
    in JAX, or if the folder cannot be written.
    """
    folder = cache_folder().absolute() / "programs"
    settings = {
        "JAX_COMPILATION_CACHE_DIR": str(folder),
        "JAX_COMPILATION_CACHE_MAX_SIZE": MAX_PROGRAM_BYTES,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": 0.05,
    }
    if any(name in os.environ for name in settings):
        return
    # JAX reads environment variables when it is imported
    config = getattr(sys.modules.get("jax"), "config", None)
    if config is not None and config.jax_compilation_cache_dir is not None:
        return
    if not _can_write(folder):
        return
    for name, value in settings.items():
        if config is None:
            os.environ[name] = str(value)
        else:
            config.update(name.lower(), value)
    delete_incomplete_programs(folder)


def _can_write(folder: Path) -> bool:
    """Whether files can be written in a folder, which is made if need be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)


def delete_incomplete_programs(folder: Path) -> None:
    """Delete cached programs without a time stamp, which a killed process leaves.

    JAX stores no new programs while such a file exists.
    """
    with suppress(OSError):
        names = set(os.listdir(folder))
        for name in names:
            stem = name.removesuffix("-cache")
            if stem != name and f"{stem}-atime" not in names:
                (folder / name).unlink(missing_ok=True)
