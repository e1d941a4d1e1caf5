"""Packages of extras, imported only when a file needs them."""

import os
from importlib import import_module
from types import ModuleType

from s2c2a.logs.errors import LogError


def extra_module(module: str, path: str | os.PathLike, form: str) -> ModuleType:
    """Import a module of the extra `tables`.

    Raises:
        LogError: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise LogError(
            f"{path} cannot be read. {form}: export as CSV, or install the extra: "
            'pip install "s2c2a[tables]"'
        ) from error
