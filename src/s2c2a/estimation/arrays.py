"""Validation of measured values as arrays of numbers."""

from typing import Any

import numpy as np


def numbers_of_shape(values: Any, shape: tuple[int | None, ...]) -> np.ndarray | None:
    """Values as an array of numbers; None if they have another shape or type.

    Args:
        values: value of a sensor in a reading, of any type.
        shape: expected shape; None stands for any length but zero.
    """
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        return None
    if array.ndim != len(shape):
        return None
    for length, expected in zip(array.shape, shape, strict=True):
        if length != expected if expected is not None else length == 0:
            return None
    return array
