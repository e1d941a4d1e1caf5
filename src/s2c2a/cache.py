"""What is kept between runs: recordings, networks, compiled programs. All of it is safe to delete."""

import os
from contextlib import suppress
from pathlib import Path

import platformdirs

MAX_BYTES_OF_PROGRAMS = 500_000_000


def cache_folder() -> Path:
    """Where things are kept; `S2C2A_CACHE` moves it."""
    return Path(os.environ.get("S2C2A_CACHE") or platformdirs.user_cache_dir("s2c2a"))


def keep_programs() -> None:
    """Have JAX keep what it compiles, so that a second start is quick; the longest unused goes first.

    It works before JAX is imported, and where the user has said nothing else of JAX's
    own cache.
    """
    folder = cache_folder() / "programs"
    settings = {
        "JAX_COMPILATION_CACHE_DIR": folder,
        "JAX_COMPILATION_CACHE_MAX_SIZE": MAX_BYTES_OF_PROGRAMS,
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": 0.05,
    }
    if not any(name in os.environ for name in settings):
        os.environ.update({name: str(value) for name, value in settings.items()})
        throw_out_halves(folder)


def throw_out_halves(folder: Path) -> None:
    """Programs without the time of their last use, as a killed process leaves them: JAX keeps nothing beside them."""
    with suppress(OSError):
        for program in folder.glob("*-cache"):
            if not program.with_name(
                program.name.removesuffix("-cache") + "-atime"
            ).exists():
                program.unlink(missing_ok=True)
