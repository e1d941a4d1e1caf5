"""Modules that need the extra `bench`, imported when they are asked for."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from s2c2a.errors import S2C2AError

INSTALL = 'install it, in your clone of s2c2a, with `pip install ".[bench]"`'


class MissingExtraError(S2C2AError):
    """Something to compare with is not installed."""


def module_with(package: str, module: str) -> Any:
    """A module of this room that needs a package.

    Raises:
        MissingExtraError: the package is not installed.
    """
    if find_spec(package) is None:
        raise MissingExtraError(f"{package} is not installed; {INSTALL}")
    return import_module(f"s2c2a.bench.{module}")
