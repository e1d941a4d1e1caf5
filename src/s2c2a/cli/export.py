"""Command `s2c2a export`: recordings and trained strategies for other programs."""

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro

from s2c2a.arm import arm_to_toml
from s2c2a.cli.console import GivenPath, OptionalPath
from s2c2a.cli.export_table import Columns, import_map, table_of, units_of
from s2c2a.episodes import Episode, load_episodes
from s2c2a.errors import S2C2AError, counted
from s2c2a.files.text import atomic_write, write_atomically
from s2c2a.plugins.discovery import installed, resolve, trust_code

OptionalForm = Annotated[str | None, tyro.conf.arg(metavar="FORM")]


def export(file: GivenPath, out: OptionalPath = None, to: OptionalForm = None) -> None:
    """Write a recording, a run or a trained strategy for other programs (docs/guides/export.md).

    NPZ and MAT hold every column of every episode as an array, such as
    episode1.sensor_cables; the arm file and the options are text. CSV and Parquet hold
    one table of all episodes, with a column for each number, such as sensor.cables.1.2;
    FILE.map.toml beside it imports it again.

    Args:
        file: the recording, such as mine.episodes, a run, such as
            runs/circle/twin_arm.episodes, or the strategy, such as mine.safetensors.
        out: where to write, such as mine.csv; replaced if it exists. By default, the
            name of the file with the form as its ending, in the current folder.
        to: the form: csv, parquet, npz, mat, c, gif, mp4, lerobot, mcap, onnx, of
            a plug-in, or module:function; by default, the ending of --out.
    """
    form = to or (out.suffix.removeprefix(".") if out else "")
    if not form:
        given = f"--out '{out}' has no ending" if out else "no --out was given"
        known = ", ".join([*FORMS, *installed("export")])
        raise S2C2AError(f"{given}; add --to with one of {known}")
    trust_code(form)
    write: ExportForm = resolve("export", form, FORMS)
    target = out or Path(f"{file.stem}.{form}")
    if target.exists() and target.samefile(file):
        raise S2C2AError(f"--out '{target}' is the file itself; choose another name")
    written = write(file, target)
    if not target.exists():  # it begins the names of several files
        target = target.with_suffix(f".*{target.suffix}")
    print(f"{written}: {target}")


ExportForm = Callable[[Path, Path], str]
"""Writes what a file holds to a path; returns what it wrote, such as "3 episodes"."""
Texts = dict[str, str]
TableWriter = Callable[[Columns, Texts, Texts, Path], None]


def _table_form(write: TableWriter) -> ExportForm:
    """The form of a table: it writes the map, too, if module ends were measured."""

    def export_table(file: Path, out: Path) -> str:
        episodes, options = load_episodes(file)
        table = table_of(episodes)
        write(table, units_of(episodes), _texts(episodes, options), out)
        if text := import_map(episodes, table, bool(options.get("at_rest"))):
            write_atomically(text, f"{out}.map.toml")
        return counted(len(episodes), "episode")

    return export_table


def _texts(episodes: Sequence[Episode], options: dict[str, Any]) -> Texts:
    return {"arm": arm_to_toml(episodes[0].arm), "options": json.dumps(options)}


def _write_csv(table: Columns, units: Texts, texts: Texts, out: Path) -> None:
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


def _write_parquet(table: Columns, units: Texts, texts: Texts, out: Path) -> None:
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


def _arrays(
    episodes: Sequence[Episode], options: dict[str, Any]
) -> dict[str, str | dict[str, Any]]:
    """Texts, and the columns of every episode by name."""
    content: dict[str, str | dict[str, Any]] = {**_texts(episodes, options)}
    for number, episode in enumerate(episodes, 1):
        # MATLAB allows no point in a name
        columns: dict[str, Any] = {
            name.replace(".", "_"): values for name, values in episode.columns.items()
        }
        columns["options"] = json.dumps(dict(episode.options))
        content[f"episode{number}"] = columns
    return content


def _export_npz(file: Path, out: Path) -> str:
    episodes, options = load_episodes(file)
    flat: dict[str, Any] = {}  # such as `episode1.time`
    for name, value in _arrays(episodes, options).items():
        if isinstance(value, dict):
            flat |= {f"{name}.{column}": array for column, array in value.items()}
        else:
            flat[name] = value
    with atomic_write(out) as part, open(part, "wb") as archive:
        np.savez_compressed(archive, **flat)
    return counted(len(episodes), "episode")


def _export_mat(file: Path, out: Path) -> str:
    from scipy.io import savemat

    episodes, options = load_episodes(file)
    content = _arrays(episodes, options)
    with atomic_write(out) as part, open(part, "wb") as mat:
        savemat(
            mat, content, long_field_names=True, do_compression=True, oned_as="column"
        )
    return counted(len(episodes), "episode")


FORMS: dict[str, ExportForm] = {
    "csv": _table_form(_write_csv),
    "parquet": _table_form(_write_parquet),
    "npz": _export_npz,
    "mat": _export_mat,
}
"""Forms of the core; others are entry points of `s2c2a.exports`."""
