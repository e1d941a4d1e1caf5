"""NPZ and MAT files as named columns; pickled objects are never loaded."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from s2c2a.logs.array_orientation import orient_arrays
from s2c2a.logs.errors import MAX_COLUMNS, MAX_ROWS, LogError, reading_as
from s2c2a.logs.mat_files import read_mat_arrays
from s2c2a.logs.tables import ColumnRequest, Table, table_of_arrays


def read_npz(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read the requested columns of an NPZ file.

    The columns of an array with several axes are named `name.0`, `name.1`, and so on.

    Raises:
        LogError: the file is not an NPZ file, is too large, or holds objects.
    """
    with (
        reading_as(path, "NPZ", "save plain arrays of numbers"),
        np.load(path, allow_pickle=False) as arrays,
    ):
        columns = _split_columns(orient_arrays(dict(arrays), request))
    return table_of_arrays(path, columns, request)


def read_mat(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read the requested columns of a MAT file up to version 7, named as in `read_npz`.

    Raises:
        LogError: the file is damaged, of version 7.3 (HDF5), or too large.
    """
    with reading_as(path, "MAT", "save plain arrays of numbers with -v7"):
        columns = _split_columns(orient_arrays(read_mat_arrays(path), request))
    return table_of_arrays(path, columns, request)


def _split_columns(arrays: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """One column for each one-dimensional array or column of a larger one."""
    columns: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        array = np.asarray(array)
        # structures, cells, objects, and arrays without any value are skipped
        if array.dtype.kind not in "fiubUM" or not array.size:
            continue
        if array.ndim == 2 and 1 in array.shape:
            array = array.reshape(-1)
        if array.ndim and len(array) > MAX_ROWS:
            raise LogError(
                f"'{name}' has {len(array)} rows; at most {MAX_ROWS} are read. "
                "Split the file"
            )
        if array.ndim == 1:
            columns[name] = array
            continue
        flat = array.reshape(len(array), -1) if array.ndim else array.reshape(1, 1)
        count = flat.shape[1]
        if len(columns) + count > MAX_COLUMNS:
            raise LogError(
                f"'{name}' has {count} columns; at most {MAX_COLUMNS} are read. "
                "Save arrays with one row per sample"
            )
        columns |= {f"{name}.{index}": flat[:, index] for index in range(count)}
    return columns
