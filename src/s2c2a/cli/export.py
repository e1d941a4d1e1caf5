"""Command `s2c2a export`: episodes as arrays or tables, for other programs."""

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from s2c2a.arm import arm_to_toml
from s2c2a.cli.export_table import Columns, import_map, table_of, units_of
from s2c2a.episodes import Episode, load_episodes
from s2c2a.errors import S2C2AError
from s2c2a.files import atomic_write, write_atomically

RecordingFile = tyro.conf.Positional[Annotated[Path, tyro.conf.arg(metavar="FILE")]]
TABLES = ".csv", ".parquet"
ENDINGS = ".npz", ".mat", *TABLES


def export(recording: RecordingFile, out: Path) -> None:
    """Write the episodes of a recording or run for other programs (docs/reference/episodes.md).

    NPZ and MAT hold every column of every episode as an array, such as
    episode1.sensor_cables; the arm file and the options are text. CSV and Parquet hold
    one table of all episodes, with a column for each number, such as sensor.cables.1.2;
    FILE.map.toml beside it imports it again.

    Args:
        recording: the episodes, such as mine.episodes.
        out: the file, ending in .npz, .mat, .csv or .parquet; replaced if it exists.
    """
    if out.suffix not in ENDINGS:
        raise S2C2AError(f"--out '{out}' ends in none of {', '.join(ENDINGS)}")
    episodes, options = load_episodes(recording)
    if out.suffix in TABLES:
        _write_table(episodes, options, out)
    else:
        _write_arrays(episodes, options, out)
    print(f"{len(episodes)} episodes: {out}")


def _write_table(
    episodes: Sequence[Episode], options: dict[str, Any], out: Path
) -> None:
    """Write a table, and its map if module ends were measured."""
    table = table_of(episodes)
    write = _write_csv if out.suffix == ".csv" else _write_parquet
    write(table, units_of(episodes), _texts(episodes, options), out)
    if text := import_map(episodes, table, bool(options.get("at_rest"))):
        write_atomically(text, f"{out}.map.toml")


def _texts(episodes: Sequence[Episode], options: dict[str, Any]) -> dict[str, str]:
    return {"arm": arm_to_toml(episodes[0].arm), "options": json.dumps(options)}


def _write_csv(
    table: Columns, units: dict[str, str], texts: dict[str, str], out: Path
) -> None:
    """Write numbers in full precision, NaN as empty cells, and units in a comment."""
    with (
        atomic_write(out) as part,
        open(part, "w", newline="", encoding="utf-8") as file,
    ):
        described = ", ".join(f"{name} [{unit}]" for name, unit in units.items())
        file.write(f"# {described}; NaN is empty\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        for row in zip(*(column.tolist() for column in table.values()), strict=True):
            writer.writerow("" if value != value else repr(value) for value in row)


def _write_parquet(
    table: Columns, units: dict[str, str], texts: dict[str, str], out: Path
) -> None:
    """Write a table with arm file, options and units as metadata.

    Raises:
        S2C2AError: pyarrow is missing.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise S2C2AError(
            "Parquet needs the package pyarrow: pip install 's2c2a[tables]'; "
            "or write .csv"
        ) from error
    metadata = texts | {"units": json.dumps(units)}
    with atomic_write(out) as part:
        parquet.write_table(pyarrow.table(table, metadata=metadata), part)


def _write_arrays(
    episodes: Sequence[Episode], options: dict[str, Any], out: Path
) -> None:
    content: dict[str, Any] = {**_texts(episodes, options)}
    for number, episode in enumerate(episodes, 1):
        # MATLAB allows no point in a name
        columns: dict[str, Any] = {
            name.replace(".", "_"): values for name, values in episode.columns.items()
        }
        columns["options"] = json.dumps(dict(episode.options))
        content[f"episode{number}"] = columns
    with atomic_write(out) as part, open(part, "wb") as file:
        if out.suffix == ".npz":
            np.savez_compressed(file, **_flat(content))
        else:
            from scipy.io import savemat

            savemat(file, content, long_field_names=True, do_compression=True)


def _flat(content: dict[str, Any]) -> dict[str, Any]:
    """Arrays of episodes by prefix, such as `episode1.time`."""
    flat: dict[str, Any] = {}
    for name, value in content.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{column}": array for column, array in value.items()}
        else:
            flat[name] = value
    return flat
