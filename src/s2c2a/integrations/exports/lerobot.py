"""LeRobotDataset v3.0: a folder of Parquet files, written without LeRobot.

The layout is that of lerobot 0.4.4, `lerobot/datasets/lerobot_dataset.py`. Frames are
control steps: the reading before the action, and the action.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import arm_to_toml
from s2c2a.cli.export_table import (
    EPISODE,
    LOG_TIME,
    Columns,
    import_map,
    table_of,
    units_of,
)
from s2c2a.episodes import Episode, load_episodes
from s2c2a.errors import S2C2AError, counted
from s2c2a.integrations.exports.folders import new_folder, write_map
from s2c2a.integrations.extras import needs_extra

with needs_extra("tables", "the form lerobot"):
    import pyarrow
    from pyarrow import parquet

VERSION = "v3.0"
GROUPS = {
    "observation.state": ("sensor.", ""),
    "observation.environment_state": ("desired_", "desired_"),
    "action": ("actions.", "cable."),
}
"""Prefix of the columns of each feature, and what stands for it in the feature."""
PATHS = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
FIRST = PATHS.format(chunk_index=0, file_index=0)
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
"""Those of LeRobot, by its names."""


@dataclass(frozen=True)
class Feature:
    """A feature: one number or vector a frame.

    Attributes:
        values: shape (frames, numbers).
        names: of the numbers; none of an index.
    """

    values: np.ndarray
    names: tuple[str, ...] = ()

    @property
    def info(self) -> dict[str, Any]:
        """Its entry in `info.json`."""
        return {
            "dtype": str(self.values.dtype),
            "shape": [self.values.shape[1]],
            "names": list(self.names) or None,
        }


def write_lerobot(file: Path, out: Path) -> str:
    """Write a recording as a LeRobotDataset, and the map that imports it again.

    Raises:
        S2C2AError: the folder exists, or no sensor has values.
    """
    episodes, options = load_episodes(file)
    table = table_of(episodes)
    tasks = [str(each.options.get("task", file.stem)) for each in episodes]
    features, names = _features(table, episodes, tasks)
    with new_folder(out) as folder:
        meta = folder / "meta"
        columns = {}
        for name, feature in features.items():
            numbers = pyarrow.array(feature.values.reshape(-1))
            width = feature.values.shape[1]
            lists = pyarrow.FixedSizeListArray.from_arrays
            columns[name] = numbers if width == 1 else lists(numbers, width)
        _write_table(pyarrow.table(columns), folder / "data" / FIRST)
        _write_tasks(tasks, meta / "tasks.parquet")
        _write_episodes(features, episodes, tasks, meta / "episodes" / FIRST)
        contents: dict[str, dict[str, Any]] = {
            "info": _info(features, episodes, tasks),
            "stats": {name: _stats(each.values) for name, each in features.items()},
            "s2c2a": {
                "arm": arm_to_toml(episodes[0].arm),
                "options": options,
                "units": units_of(episodes),
            },
        }
        for name, content in contents.items():
            text = json.dumps(content, indent=4, ensure_ascii=False, default=str)
            (meta / f"{name}.json").write_text(text, encoding="utf-8")
    text = import_map(episodes, table, bool(options.get("at_rest")))
    write_map(text, names, out.with_name(f"{out.name}.map.toml"))
    return counted(len(episodes), "episode")


def _features(
    table: Columns, episodes: Sequence[Episode], tasks: Sequence[str]
) -> tuple[dict[str, Feature], dict[str, str]]:
    """Features by name, and the names of their numbers by column of the table."""
    features = {}
    renamed = {EPISODE: "episode_index"}
    for feature, (prefix, place) in GROUPS.items():
        names = [
            name
            for name, column in table.items()
            if name.startswith(prefix) and np.isfinite(column).any()
        ]
        if not names:
            continue
        values = np.stack([table[name] for name in names], axis=1)
        if prefix == "desired_":
            for episode in np.unique(table[EPISODE]):
                rows = table[EPISODE] == episode
                values[rows] = held(values[rows])
        places = tuple(place + name.removeprefix(prefix) for name in names)
        features[feature] = Feature(values.astype(np.float32), places)
        renamed |= {
            name: f"{feature}.{place}"
            for name, place in zip(names, places, strict=True)
        }
    if "observation.state" not in features:
        raise S2C2AError(
            "the recording has no readings of sensors, which a LeRobotDataset needs; "
            "write another form, such as csv"
        )
    features[LOG_TIME] = Feature(table[LOG_TIME][:, None])
    return features | _indices(episodes, tasks), renamed


def held(targets: Float[np.ndarray, "steps numbers"]) -> np.ndarray:
    """Targets held where there is none, since a network learns nothing from NaN.

    Before the first target, it is that one. A column without any target stays NaN.
    """
    filled = targets.copy()
    for column in filled.T:
        known = np.flatnonzero(np.isfinite(column))
        if len(known):
            last = np.searchsorted(known, np.arange(len(column)), side="right") - 1
            column[:] = column[known[np.maximum(last, 0)]]
    return filled


def _indices(episodes: Sequence[Episode], tasks: Sequence[str]) -> dict[str, Feature]:
    """Features that every dataset has; times are nominal, as LeRobot records them."""
    lengths = [len(episode) for episode in episodes]
    frames = np.concatenate([np.arange(length) for length in lengths])
    numbers = [list(dict.fromkeys(tasks)).index(task) for task in tasks]
    times = frames / episodes[0].arm.control_rate
    columns = {
        "timestamp": times.astype(np.float32),
        "frame_index": frames,
        "episode_index": np.repeat(np.arange(len(episodes)), lengths),
        "index": np.arange(sum(lengths)),
        "task_index": np.repeat(np.array(numbers), lengths),
    }
    return {name: Feature(values[:, None]) for name, values in columns.items()}


def _info(
    features: Mapping[str, Feature], episodes: Sequence[Episode], tasks: Sequence[str]
) -> dict[str, Any]:
    rate = episodes[0].arm.control_rate
    return {
        "codebase_version": VERSION,
        "robot_type": episodes[0].arm.name,
        "total_episodes": len(episodes),
        "total_frames": sum(map(len, episodes)),
        "total_tasks": len(set(tasks)),
        "chunks_size": 1000,  # this and the next two are LeRobot's defaults
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": int(rate) if rate == int(rate) else rate,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": f"data/{PATHS}",
        "video_path": None,
        "features": {name: feature.info for name, feature in features.items()},
    }


def _stats(values: np.ndarray) -> dict[str, list]:
    """Statistics of each number; of what was measured, if some is missing."""
    values = values.astype(float)
    measured = np.isfinite(values).any(axis=0)
    values = np.where(measured, values, 0.0)
    stats = {
        "min": np.nanmin(values, axis=0),
        "max": np.nanmax(values, axis=0),
        "mean": np.nanmean(values, axis=0),
        "std": np.nanstd(values, axis=0),
    }
    for name, share in QUANTILES.items():
        stats[name] = np.nanquantile(values, share, axis=0)
    lists = {name: each.tolist() for name, each in stats.items()}
    return lists | {"count": [len(values)]}


def _write_tasks(tasks: Sequence[str], path: Path) -> None:
    """Write the tasks as an index of pandas, by which LeRobot looks them up."""
    names = list(dict.fromkeys(tasks))
    index = "__index_level_0__"
    fields = ("name", "field_name", "pandas_type", "numpy_type", "metadata")
    columns = [
        ("task_index", "task_index", "int64", "int64", None),
        (None, index, "unicode", "object", None),
    ]
    pandas = {
        "index_columns": [index],
        "column_indexes": [],
        "columns": [dict(zip(fields, column, strict=True)) for column in columns],
        "pandas_version": "2.0.0",
    }
    table = pyarrow.table(
        {"task_index": pyarrow.array(range(len(names)), "int64"), index: names},
        metadata={"pandas": json.dumps(pandas)},
    )
    _write_table(table, path)


def _write_episodes(
    features: Mapping[str, Feature],
    episodes: Sequence[Episode],
    tasks: Sequence[str],
    path: Path,
) -> None:
    rows = []
    begin = 0
    for number, (episode, task) in enumerate(zip(episodes, tasks, strict=True)):
        end = begin + len(episode)
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": [task],
            "length": len(episode),
            "data/chunk_index": 0,
            "data/file_index": 0,
            "dataset_from_index": begin,
            "dataset_to_index": end,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        for name, feature in features.items():
            stats = _stats(feature.values[begin:end])
            row |= {f"stats/{name}/{key}": values for key, values in stats.items()}
        rows.append(row)
        begin = end
    _write_table(pyarrow.Table.from_pylist(rows), path)


def _write_table(table: Any, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(table, path)
