"""Packages of extras, imported only when a file needs them."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from s2c2a.logs.errors import LogError


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
