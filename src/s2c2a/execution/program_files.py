"""Atomic writes of JAX's compilation cache; imported after JAX (`s2c2a.execution.cache`).

JAX writes a program in place, and never again while its file exists: a process killed
while writing would leave a file that every later start reads with a warning before it
compiles anew. Two writers at once would mix their bytes.
"""

import warnings
from contextlib import suppress

from s2c2a.errors import S2C2AError
from s2c2a.files.text import write_atomically

# a damaged file is compiled anew and replaced, a file that cannot be written is left out
MESSAGE = "Error (reading|writing) persistent compilation cache entry"


def _put(cache, key: str, value: bytes) -> None:
    """Write a program that JAX has not found, or could not read."""
    with suppress(S2C2AError):  # a full disk, for example
        write_atomically(value, cache.path / f"{key}-cache")


warnings.filterwarnings("ignore", MESSAGE)
with suppress(ImportError):  # private: another version may keep JAX's own writes
    from jax._src.lru_cache import LRUCache

    LRUCache.put = _put  # type: ignore[method-assign, assignment]
