"""TSV exports of Qualisys Track Manager, with their header.

The form is that of the manual, "Motion data (.tsv)" and "6DOF data (.tsv)"
(docs.qualisys.com): lines of a key and its values, the last of them the names of
markers or bodies, then an optional line of titles, and rows in millimeters.
"""

import io
import os
from collections.abc import Iterator
from itertools import chain

from s2c2a.errors import counted
from s2c2a.files.tables import parse_number, split_rows
from s2c2a.logs.capture_export import CaptureExport
from s2c2a.logs.errors import LogError

KEYS = ("FILE_VERSION", "NO_OF_FRAMES")
"""Keys with which a header begins."""
AXES = ("X", "Y", "Z")
BODY = (*AXES, "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9)))
"""Columns of a body; Rot is the rotation matrix, column by column."""
LAYOUT = ("Frame", "Time")

Rows = Iterator[tuple[int, list[str]]]


def recognizes(text: str) -> bool:
    """Whether a text begins as an export of Qualisys Track Manager."""
    return text.startswith(tuple(f"{key}\t" for key in KEYS))


def read_export(path: str | os.PathLike, text: str) -> CaptureExport:
    """Names of the columns and rows of an export.

    Columns are named `Marker.X`, or `Body.X`, `Body.Roll` and `Body.Rot[0]`, beside
    `Frame` and `Time`, which are counted with the frequency where the file has none.
    Positions of exactly zero are missing.

    Raises:
        LogError: the header names no markers or bodies, or the rows do not fit it.
    """
    rows = split_rows(io.StringIO(text, newline=""), "\t")
    keys, first = _read_header(rows)
    named = keys.get("BODY_NAMES") or keys.get("MARKER_NAMES")
    if not named or first is None:
        raise LogError(
            f"{path} is an export of Qualisys Track Manager without rows, or without "
            "names of markers or bodies; export 3D or 6D data with header"
        )
    parts = BODY if "BODY_NAMES" in keys else AXES
    names, is_counted = _names(path, first[1], named, parts)
    frequency = parse_number(keys.get("FREQUENCY", [""])[0], False)
    if is_counted and not frequency:
        raise LogError(
            f"{path} has neither times nor a FREQUENCY; export it with time data"
        )
    period = 1 / frequency if frequency else 0.0
    body_rows = _rows(chain([first], rows), names, period if is_counted else None)
    if is_counted:
        names = [*names, *LAYOUT]
    return CaptureExport(names, body_rows, "mm")


def _read_header(rows: Rows) -> tuple[dict[str, list[str]], tuple | None]:
    """Values by key, and the first row of numbers; titles above it are left out."""
    keys: dict[str, list[str]] = {}
    for line, row in rows:
        filled = [cell.strip() for cell in row if cell.strip()]
        if all(parse_number(cell, False) is not None for cell in filled):
            return keys, (line, row)
        if filled[0].isupper():
            keys[filled[0]] = filled[1:]
    return keys, None


def _names(
    path: str | os.PathLike, row: list[str], named: list[str], parts: tuple[str, ...]
) -> tuple[list[str], bool]:
    """Names of the columns, and whether frames and times are to be counted.

    A blank column may stand before each body, and one at the end.
    """
    count = len(named) * len(parts)
    for leading in (2, 1, 0):
        for gap in (0, 1):
            width = leading + count + gap * len(named)
            is_blank = not "".join(row[leading : leading + 1]).strip()
            if len(row) - width not in (0, 1) or is_blank != bool(gap):
                continue
            names = list(LAYOUT[:leading])
            for body in named:
                names += [""] * gap
                names += [f"{body}.{part}" for part in parts]
            return names, leading < 2
    raise LogError(
        f"{path} has {counted(len(row), 'column')}, and its header names {len(named)} "
        f"bodies or markers of {counted(len(parts), 'column')} each; export them "
        "again, with header"
    )


def _rows(rows: Rows, names: list[str], period: float | None) -> Rows:
    """Rows without positions of exactly zero; with frames and times if counted."""
    places = [index for index, name in enumerate(names) if name.endswith(".X")]
    for frame, (line, row) in enumerate(rows):
        for place in places:
            position = row[place : place + 3]
            if all(parse_number(cell, False) == 0.0 for cell in position):
                row[place : place + 3] = ["", "", ""]
        if period is not None:
            time = repr(frame * period)
            row = [*row[: len(names)], str(frame + 1), time]
        yield line, row
