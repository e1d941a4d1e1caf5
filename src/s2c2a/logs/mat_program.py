"""Program that reads a MAT file with SciPy, and writes its arrays to its output (NPZ).

`mat_files` runs it.
"""

import io
import math
import sys

import numpy as np
from scipy.io import loadmat

from s2c2a.execution.child import limit_memory
from s2c2a.logs.errors import MAX_COLUMNS, LogError

MAX_MEMORY = 3_000_000_000  # bytes; several times the largest log
MAX_DEPTH = 8  # of cells and structures in each other
Arrays = dict[str, np.ndarray]
"""Arrays by name."""


def main(path: str, max_bytes: str) -> None:
    """Write the arrays, numbered, and their names."""
    limit_memory(MAX_MEMORY)
    arrays: Arrays = {}
    try:
        for name, value in loadmat(path).items():
            if not name.startswith("__"):
                arrays |= _arrays_of(name, value, 0)
        size = sum(array.nbytes for array in arrays.values())
    except MemoryError:
        size = MAX_MEMORY
    except Exception as error:
        sys.exit(str(error))
    if size > int(max_bytes):
        sys.exit(f"it unpacks to more than {max_bytes} bytes; save fewer rows")
    if len(arrays) > MAX_COLUMNS:
        sys.exit(f"it holds more than {MAX_COLUMNS} arrays; save fewer")
    content = io.BytesIO()
    np.savez(content, *arrays.values(), names=np.array(list(arrays), str))
    sys.stdout.buffer.write(content.getvalue())


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
    if len(names) == 1 and len(shapes) == 1 and math.prod(*shapes) < len(parts):
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


if __name__ == "__main__":
    main(*sys.argv[1:])
