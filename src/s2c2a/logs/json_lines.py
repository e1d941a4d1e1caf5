"""JSON lines: one object a line, whose nested keys and arrays become columns."""

import io
import json
import os
from collections.abc import Iterator
from typing import Any

from s2c2a.files.tables import read_any_text
from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, LogError
from s2c2a.logs.tables import ColumnRequest, Table, TableBuilder

_BROKEN = "it is not one complete JSON object"


def read_json_lines(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read a file of JSON lines, which may be gzipped.

    Values of nested objects and arrays are named `pose.position.x` and `u.0`. A key
    that a line lacks is a missing value.

    Raises:
        LogError: the file cannot be read or is too large, has none of the columns, or a
            line is broken or holds text in a numeric column.
    """
    text = read_any_text(path, LogError, MAX_BYTES)
    builder = TableBuilder(path, request, _names(path, text))
    wanted = [*builder.numbers, *builder.labels]
    for line, entry in _objects(text):
        values = dict.fromkeys(wanted)
        if entry is None:
            fault = f"{_BROKEN}; write one object a line"
            builder.add(f"line {line}", list(values.values()), fault)
            continue
        values |= {name: value for name, value in leaves(entry) if name in values}
        builder.add(f"line {line}", list(values.values()))
    return builder.build()


def _names(path: str | os.PathLike, text: str) -> dict[str, None]:
    """Names of the columns of all lines, in the order in which they occur."""
    names: dict[str, None] = {}
    for line, entry in _objects(text):
        if entry is None and not names:
            raise LogError(
                f"{path}, line {line}: {_BROKEN}; JSON is read one object a line (JSON "
                "lines): write it so, or save the log as CSV"
            )
        for name, _ in leaves(entry or {}):
            names[name] = None
            if len(names) > MAX_COLUMNS:
                raise LogError(
                    f"{path} has more than {MAX_COLUMNS} columns; leave out long arrays"
                )
    return names


def _objects(text: str) -> Iterator[tuple[int, dict[str, Any] | None]]:
    """Yield line numbers and objects; None for a line that is no object."""
    for number, line in enumerate(io.StringIO(text), 1):
        if not line.strip():
            continue
        try:
            entry = json.loads(line)
        # ValueError: no JSON, or an integer of thousands of digits
        except (ValueError, RecursionError):
            entry = None
        yield number, entry if isinstance(entry, dict) else None


def leaves(entry: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each number, text or null in an object."""
    waiting = [("", entry)]
    while waiting:
        name, value = waiting.pop()
        if isinstance(value, dict):
            parts = list(value.items())
        elif isinstance(value, list):
            parts = [(str(index), part) for index, part in enumerate(value)]
        else:
            yield name, value
            continue
        begin = f"{name}." if name else ""
        waiting += [(f"{begin}{key}", part) for key, part in reversed(parts)]
