"""Errors and size limits of imported logs."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from s2c2a.errors import S2C2AError

MAX_BYTES = 400_000_000  # of one log after decompression
MAX_ROWS = 2_000_000
MAX_COLUMNS = 4096


class LogError(S2C2AError):
    """A log or its map cannot be used."""


@contextmanager
def reading_as(path: str | os.PathLike, form: str, way_out: str) -> Iterator[None]:
    """Turn any error of a library that reads an untrusted file into one with advice.

    Args:
        path: of the file.
        form: as which it is read.
        way_out: what to do.

    Raises:
        LogError: the block raised an exception; one of this type is not changed.
    """
    try:
        yield
    except (LogError, MemoryError):
        raise
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise LogError(
            f"{path} cannot be read as {form}: {reason:.200}; {way_out}"
        ) from error


@contextmanager
def needs_extra(path: str | os.PathLike, form: str) -> Iterator[None]:
    """Explain a missing package of the extra `tables`, imported in the block.

    Raises:
        LogError: it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise LogError(
            f"{path} cannot be read. {form}: export as CSV, or install the extra: "
            'pip install "s2c2a[tables]"'
        ) from error
