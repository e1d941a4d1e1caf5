"""Parquet files as tables."""

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from s2c2a.logs.errors import (
    MAX_COLUMNS,
    MAX_ROWS,
    LogError,
    needs_extra,
    reading_as,
)
from s2c2a.logs.tables import ColumnRequest, Table, table_of_arrays


def read_parquet(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read the requested columns; fields of structures and lists are `p.x` and `u.0`.

    Raises:
        LogError: the extra is missing, or the file is damaged, too large, or has none
            of the columns.
    """
    with reading_as(path, "Parquet", "save it as CSV"):
        columns = parquet_arrays(path, request)
        return table_of_arrays(path, columns, request)


def parquet_arrays(
    path: str | os.PathLike, request: ColumnRequest
) -> dict[str, np.ndarray]:
    """Arrays of the requested columns; of others, empty ones.

    Raises:
        LogError: the extra is missing, or the file is too large.
    """
    with needs_extra(path, "Parquet"):
        import pyarrow.parquet as parquet  # noqa: PLC0415  # an extra
    # a few words in many rows stay a few words
    words = [field.name for field in parquet.read_schema(path) if _is_text(field.type)]
    with parquet.ParquetFile(path, read_dictionary=words) as file:
        _check_size(path, file.metadata)
        columns = dict.fromkeys(file.schema_arrow.names, np.empty(0))
        for name in list(columns):
            if not _is_requested(name, request):
                continue
            values = file.read(columns=[name]).column(name)
            columns |= _leaves(name, values.combine_chunks())
    return columns


def _check_size(path: str | os.PathLike, metadata: Any) -> None:
    limits = {
        "rows": (metadata.num_rows, MAX_ROWS),
        "columns": (metadata.num_columns, MAX_COLUMNS),
    }
    for name, (count, limit) in limits.items():
        if count > limit:
            raise LogError(
                f"{path} has {count} {name}; at most {limit} are read. Split the file"
            )


def _is_requested(name: str, request: ColumnRequest) -> bool:
    """Whether a column, or a part of it, is requested."""
    if name in request.names:
        return True
    return any(each.startswith(f"{name}.") for each in request.names)


def _leaves(name: str, values: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield name and values of each column within a column."""
    kind = values.type
    if hasattr(kind, "index_type"):
        # elements of a dictionary array, equal ones as one object; None is missing
        words = np.array([*values.dictionary.to_pylist(), None], dtype=object)
        indices = values.indices.fill_null(len(words) - 1)
        yield name, words[indices.to_numpy(zero_copy_only=False)]
    elif hasattr(kind, "fields"):
        for field, part in zip(kind.fields, values.flatten(), strict=True):
            yield from _leaves(f"{name}.{field.name}", part)
    elif hasattr(kind, "value_type"):
        size = len(values.flatten()) // max(len(values), 1)
        lists = values.to_pylist()
        if any(each is None or len(each) != size for each in lists):
            return  # of different lengths: no columns
        for index, column in enumerate(np.array(lists).T):
            yield f"{name}.{index}", column
    else:
        yield name, values.to_numpy(zero_copy_only=False)


def _is_text(kind: Any) -> bool:
    return str(kind) in ("string", "large_string", "binary", "large_binary")
