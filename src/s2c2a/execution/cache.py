"""Cache folder of recordings, networks and compiled programs; it is safe to delete."""

import os
import sys
import time
from contextlib import suppress
from pathlib import Path

import platformdirs

from s2c2a.execution.after_import import import_after
from s2c2a.files.text import MAX_BYTES

IMPORTED = time.time()
"""When `import s2c2a` read the first sources [s]."""


def cache_folder() -> Path:
    """Path of the cache folder; the environment variable `S2C2A_CACHE` overrides it."""
    return Path(os.environ.get("S2C2A_CACHE") or platformdirs.user_cache_dir("s2c2a"))


def enable_compilation_cache() -> None:
    """Enable JAX's persistent compilation cache, so that a second start is fast.

    JAX's own bound stays off: for each new program, it looks at all files under a lock
    that all processes share. `import s2c2a` calls this. It does nothing if the user has
    configured JAX's cache, by environment variables or before in JAX, or if the folder
    cannot be written.
    """
    folder = cache_folder().absolute() / "programs"
    programs = str(folder)
    settings = {
        "JAX_COMPILATION_CACHE_DIR": programs,
        "JAX_COMPILATION_CACHE_MAX_SIZE": "-1",
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.05",
    }
    # a process that this one starts inherits them
    if any(os.environ.get(name, value) != value for name, value in settings.items()):
        return
    # JAX reads environment variables when it is imported
    config = getattr(sys.modules.get("jax"), "config", None)
    if config and config.jax_compilation_cache_dir not in (None, programs):
        return
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
    if not os.access(programs, os.W_OK | os.X_OK):
        return
    os.environ.update(settings)
    if config:
        config.update("jax_compilation_cache_dir", programs)
        config.update("jax_persistent_cache_min_compile_time_secs", 0.05)
    import_after("jax", "s2c2a.execution.program_files")
    trim_daily(folder, folder.with_name("executables"))


def trim_daily(*folders: Path, max_bytes: int = MAX_BYTES) -> None:
    """Once a day, delete the files that were used longest ago until the rest fits.

    Most file systems note a file's use once a day; on the others, age counts from
    writing. It waits for no other process: a missing file is compiled anew.

    Args:
        folders: the first one holds an empty file with the date.
        max_bytes: of all folders together, on the user's disk.
    """
    today = folders[0] / f".trimmed-{time.strftime('%Y-%m-%d')}"
    try:
        today.touch(exist_ok=False)
    except OSError:  # done, or the disk is full
        return
    files = []
    for path in (path for folder in folders for path in folder.glob("*")):
        with suppress(OSError):  # another process has deleted it
            status = path.stat()
            files.append((max(status.st_atime, status.st_mtime), status.st_size, path))
    total = 0
    for _, size, path in sorted(files, reverse=True):
        total += size
        # left by a killed process, by another day, or by JAX's own bound
        is_rest = path.name.startswith(".") or path.name.endswith("-atime")
        if total > max_bytes or (is_rest and path != today):
            with suppress(OSError):
                path.unlink()
