"""Values that nothing can change, for what crosses the border to foreign code."""

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import fields
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np


def immutable(values: np.ndarray) -> np.ndarray:
    """Return a copy of an array that NumPy does not change, not even by its flags.

    The memory belongs to Python bytes. Code in C can write there past NumPy, so an array
    that is immutable already is copied, too: nobody else has the address of the copy.
    """
    if values.dtype.hasobject:
        copied = deepcopy(values)
        copied.setflags(write=False)
        return copied
    return np.ndarray(values.shape, values.dtype, values.tobytes())


def immutable_table(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a copy of named values that nothing can change; see `immutable`."""
    return MappingProxyType(
        {name: immutable_value(value) for name, value in table.items()}
    )


def immutable_value(value: Any) -> Any:
    """Return a copy of a value; what is no array or number is copied only.

    A robot may return anything where an array or a number is due.
    """
    return immutable(value) if isinstance(value, np.ndarray) else deepcopy(value)


def rebuilt(value: Any) -> tuple[Callable[[], Any], tuple[()]]:
    """Return how `pickle` builds a frozen dataclass with immutable tables again."""
    values = {field.name: getattr(value, field.name) for field in fields(value)}
    plain = {
        name: dict(content) if isinstance(content, MappingProxyType) else content
        for name, content in values.items()
    }
    build: Callable[..., Any] = type(value)
    return partial(build, **plain), ()
