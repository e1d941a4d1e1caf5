"""Values that nothing can change, for what crosses the border to foreign code."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import fields
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np


def immutable(value: Any) -> Any:
    """Return a copy of an array that NumPy does not change, not even by its flags.

    The memory belongs to Python bytes. Code in C can write there past NumPy, so an array
    that is immutable already is copied, too: nobody else has the address of the copy. A
    robot may return anything where an array is due: what is none is copied only.
    """
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return np.ndarray(value.shape, value.dtype, value.tobytes())
    copied = deepcopy(value)
    if isinstance(copied, np.ndarray):
        copied.setflags(write=False)
    return copied


def immutable_table(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a copy of named values that nothing can change; see `immutable`."""
    return MappingProxyType({name: immutable(value) for name, value in table.items()})


def rebuilt(value: Any) -> tuple[Callable[[], Any], tuple[()]]:
    """Return how `pickle` builds a frozen dataclass with immutable tables again."""
    values = {field.name: getattr(value, field.name) for field in fields(value)}
    plain = {
        name: dict(content) if isinstance(content, MappingProxyType) else content
        for name, content in values.items()
    }
    build: Callable[..., Any] = type(value)
    return partial(build, **plain), ()
