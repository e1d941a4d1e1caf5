"""Folders of LeRobotDatasets (v3) as tables."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic_core import from_json

from s2c2a.files.text import read_text
from s2c2a.logs.errors import MAX_BYTES, MAX_ROWS, LogError, reading_as
from s2c2a.logs.parquet_files import parquet_arrays
from s2c2a.logs.tables import ColumnRequest, Table, table_of_arrays

INFO = Path("meta", "info.json")
TIME = "log_time"
"""Column of times that go on from episode to episode [s]."""
INDEX = "index"
VERSION = "v3."


def is_lerobot(path: str | os.PathLike) -> bool:
    """Whether a folder is a LeRobotDataset."""
    return (Path(path) / INFO).is_file()


def read_lerobot(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read the requested columns of all episodes.

    The numbers of a feature are `action.NAME` with the names that the dataset gives,
    else `action.0`. `log_time` is `index` over the frame rate, unless there is a
    feature of that name.

    Raises:
        LogError: the extra is missing, or the dataset is of another version, damaged,
            or too large.
    """
    with reading_as(
        path, "LeRobotDataset", "load it with LeRobot, and save its table as CSV"
    ):
        info = _info_of(Path(path))
        columns = _columns(Path(path), request)
        # columns by the names of their numbers in a feature
        renamed = {}
        for feature, description in info["features"].items():
            for place, name in enumerate(_names_in(description)):
                renamed[f"{feature}.{place}"] = f"{feature}.{name}"
                if description["shape"] == [1]:
                    renamed[feature] = f"{feature}.{name}"
        columns = {renamed.get(name, name): values for name, values in columns.items()}
        if TIME not in columns and len(columns[INDEX]):
            columns[TIME] = columns[INDEX] / float(info["fps"])
        return table_of_arrays(path, columns, request)


def _info_of(path: Path) -> dict[str, Any]:
    info = from_json(read_text(path / INFO, LogError))
    version = str(info["codebase_version"])
    if not version.startswith(VERSION):
        raise LogError(
            f"{path} is a LeRobotDataset of version {version:.20}; {VERSION}0 is read: "
            "convert it with LeRobot's convert_dataset_v21_to_v30"
        )
    return info


def _columns(path: Path, request: ColumnRequest) -> dict[str, np.ndarray]:
    """Columns of the files, one below the other."""
    files = sorted(path.glob("data/*/*.parquet"))
    size = sum(file.stat().st_size for file in files)
    if size > MAX_BYTES:
        raise LogError(
            f"{path} has {size} bytes in its tables; at most {MAX_BYTES} are read. "
            "Export fewer episodes"
        )
    wider = replace(request, numbers={*request.numbers, INDEX})
    parts: dict[str, list[np.ndarray]] = {}
    rows = 0
    for file in files:
        columns = parquet_arrays(file, wider)
        rows += len(columns[INDEX])
        if rows > MAX_ROWS:
            raise LogError(
                f"{path} has more than {MAX_ROWS} frames; export fewer episodes"
            )
        for name, values in columns.items():
            parts.setdefault(name, []).append(values)
    if not files:
        raise LogError(f"{path} has no tables in data; check that it is complete")
    return {name: np.concatenate(values) for name, values in parts.items()}


def _names_in(description: Mapping[str, Any]) -> list[str]:
    """Names of the numbers of a feature; datasets also have them under a heading."""
    names = description.get("names") or []
    if isinstance(names, dict):
        names = next((each for each in names.values() if isinstance(each, list)), [])
    return [str(name) for name in names]
