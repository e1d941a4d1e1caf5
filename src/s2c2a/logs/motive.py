"""CSV exports of Motive (OptiTrack).

The form is that of the manual, "Data Export: CSV" (docs.optitrack.com): a line of keys
and values, a blank line, and a header of several lines: types, names and identifiers
of assets, "Rotation" or "Position", and "Frame,Time (Seconds),X,Y,Z,W,...".
"""

import io
import os
from collections.abc import Sequence
from itertools import islice

from s2c2a.files.tables import split_rows
from s2c2a.logs.capture_export import CaptureExport
from s2c2a.logs.errors import LogError

BEGIN = "Format Version"
UNITS = {"meters": "m", "centimeters": "cm", "millimeters": "mm"}
"""Units of lengths by their names in the header."""
MAX_HEADER = 12  # rows of the header; Motive 3 has 7


def recognizes(text: str) -> bool:
    """Whether a text begins as an export of Motive."""
    return text.startswith(BEGIN)


def read_export(path: str | os.PathLike, text: str) -> CaptureExport:
    """Names of the columns and rows of an export.

    Columns are named `Body.Position.X`, `Body.Rotation.W`, and `Marker.X`.

    Raises:
        LogError: the header has no line "Frame".
    """
    rows = split_rows(io.StringIO(text, newline=""), ",")
    header: list[list[str]] = []
    for _, row in islice(rows, MAX_HEADER):
        header.append([cell.strip() for cell in row])
        if header[-1][0] == "Frame":
            break
    if header[-1][0] != "Frame":
        raise LogError(
            f'{path} begins as an export of Motive, and has no line "Frame,Time '
            '(Seconds),..."; export it with header'
        )
    cells = header[0]
    unit = ""
    if "Length Units" in cells[:-1]:
        stated = cells[cells.index("Length Units") + 1]
        unit = UNITS.get(stated.lower(), "")
    return CaptureExport(_names(header), rows, unit)


def _names(header: Sequence[list[str]]) -> list[str]:
    letters = header[-1]
    by_key = {}
    for row in header:
        if len(row) > 1 and not row[0]:
            by_key[row[1]] = row
    types = _padded(by_key.get("Type", []), len(letters))
    bodies = _padded(by_key.get("Name", []), len(letters))
    kinds = _padded(header[-2], len(letters))
    names = letters[:2]
    for place in range(2, len(letters)):
        is_marker = "marker" in types[place].lower() and kinds[place] == "Position"
        kind = "" if is_marker else kinds[place]
        parts = (bodies[place], kind, letters[place])
        names.append(".".join(part for part in parts if part))
    return names


def _padded(row: list[str], width: int) -> list[str]:
    return row + [""] * (width - len(row))
