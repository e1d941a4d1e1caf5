"""MAT files of versions 4 to 7: arrays of numbers and text, which SciPy reads."""

import math
import os

import numpy as np

from s2c2a.logs.errors import MAX_COLUMNS, LogError

HDF5 = b"\x89HDF\r\n\x1a\n"
HEADER = 128  # bytes; text that names the version
MAX_DEPTH = 8  # of cells and structures in each other
Arrays = dict[str, np.ndarray]
"""Arrays by name."""


def read_mat_arrays(path: str | os.PathLike) -> Arrays:
    """Arrays of numbers and of text, by name; other values are left out.

    Fields of structures are `log.t`, cells `u.0`; equal parts of an array of structures
    or cells are one array, one row for each.

    A matrix of characters becomes an array of its rows.

    Raises:
        LogError: the file is of another version, or has too many parts.
    """
    from scipy.io import loadmat  # noqa: PLC0415  # takes time

    with open(path, "rb") as file:
        head = file.read(HEADER)
    if head.startswith(HDF5) or b"MATLAB 7.3" in head:
        raise LogError(
            f"{path} is a MAT file of version 7.3 (HDF5), which is not supported; "
            "save it with -v7 in MATLAB"
        )
    arrays: Arrays = {}
    for name, value in loadmat(path, appendmat=False).items():
        if not name.startswith("__"):
            arrays |= _arrays_of(name, value, 0)
    return arrays


def _arrays_of(name: str, value: object, depth: int) -> Arrays:
    """Numbers and texts of a value by name; those of cells and structures with a dot.

    Complex numbers, functions, objects and sparse matrices are left out.
    """
    if type(value) is not np.ndarray:
        return {}
    if value.dtype.kind in "fiubU":
        return {name: value}
    if value.dtype.kind not in "OV":
        return {}
    if depth >= MAX_DEPTH:
        raise LogError(f"structures and cells are nested more than {MAX_DEPTH} deep")
    arrays: Arrays = {}
    for field in value.dtype.names or [""]:
        cells = value[field] if field else value
        parts = [_arrays_of("", cell, depth + 1) for cell in cells.ravel(order="F")]
        label = _joined(name, field)
        if field and len(parts) == 1:
            arrays |= _named(label, parts[0])
        else:
            arrays |= _combined(label, parts)
    return arrays


def _joined(name: str, part: str) -> str:
    """A name with a dot before its part; either may be empty."""
    return ".".join(filter(None, (name, part)))


def _named(name: str, arrays: Arrays) -> Arrays:
    """The same arrays as parts of a name."""
    return {_joined(name, part): array for part, array in arrays.items()}


def _combined(name: str, parts: list[Arrays]) -> Arrays:
    """One array of equal small parts, one row for each; otherwise each by its number."""
    shapes = {each.shape for part in parts for each in part.values()}
    names = {tuple(part) for part in parts}
    are_alike = len(names) == 1 and len(shapes) == 1
    if are_alike and math.prod(*shapes) < len(parts):
        rows = {
            key: np.stack([part[key].reshape(-1) for part in parts]) for key in parts[0]
        }
        return _named(name, rows)
    if len(parts) > MAX_COLUMNS:
        raise LogError(
            f"'{name}' has {len(parts)} cells; at most {MAX_COLUMNS} of different sizes "
            "are read. Save plain arrays"
        )
    arrays: Arrays = {}
    for index, part in enumerate(parts):
        arrays |= _named(_joined(name, str(index)), part)
    return arrays
