"""Arrays of channels x samples, which are transposed to one row per sample."""

from collections.abc import Mapping

import numpy as np

from s2c2a.logs.errors import LogError
from s2c2a.logs.tables import ColumnRequest


def orient_arrays(
    arrays: Mapping[str, np.ndarray], request: ColumnRequest
) -> dict[str, np.ndarray]:
    """Arrays with one row per sample.

    The number of samples is the length of the requested vectors, or the one that all
    requested matrices have in common. Without either, a wide matrix is transposed if
    each of its rows is requested.

    Raises:
        LogError: the rows of a wide matrix may be samples or channels.
    """
    channels = _requested_channels(arrays, request)
    samples = _samples(arrays, channels, request)
    oriented = dict(arrays)
    for name, requested in channels.items():
        rows, columns = arrays[name].shape
        is_across = columns == samples != rows
        if samples is None and rows < columns:
            is_across = requested == set(range(rows))
            if not is_across:
                raise LogError(
                    f"'{name}' is {rows} x {columns}, and the map names "
                    f"{len(requested)} of its columns; save one row per sample, such as "
                    f"{name} = {name}.'"
                )
        if is_across:
            oriented[name] = arrays[name].T
    return oriented


def _requested_channels(
    arrays: Mapping[str, np.ndarray], request: ColumnRequest
) -> dict[str, set[int]]:
    """Numbers of the requested columns of each matrix."""
    channels: dict[str, set[int]] = {}
    for column in request.names:
        name, _, number = column.rpartition(".")
        if name not in arrays or not number.isdecimal() or len(number) > len("4096"):
            continue
        if arrays[name].ndim == 2 and 1 not in arrays[name].shape:
            channels.setdefault(name, set()).add(int(number))
    return channels


def _samples(
    arrays: Mapping[str, np.ndarray],
    channels: Mapping[str, set[int]],
    request: ColumnRequest,
) -> int | None:
    """Number of samples, if it is the only one that fits."""
    lengths = {arrays[name].size for name in request.names if name in arrays}
    if not lengths and channels:
        shapes = [set(arrays[name].shape) for name in channels]
        lengths = set.intersection(*shapes)
        if len(shapes) == 1 and len(lengths) == 1:
            return None  # a square
    if len(lengths) != 1:
        return None
    return lengths.pop()
