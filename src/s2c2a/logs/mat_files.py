"""MAT files of version 5: arrays of numbers and text, read with checks at every step.

The format is that of the manual "MAT-File Format" (The MathWorks, 2019, chapter 1): a
header of 128 bytes, then elements of a type, a size and their content. Every size is
checked against what is there before anything is read, in plain Python: readers in
native code trust these sizes, and a damaged file ends the whole process.
"""

import math
import os
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, MAX_ROWS, LogError

HDF5 = b"\x89HDF\r\n\x1a\n"
HEADER = 128  # bytes
MATRIX = 14
COMPRESSED = 15
INT32 = 5
UINT32 = 6
NUMBERS = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
"""Types of elements that hold numbers."""
TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16"}
"""Encodings of characters by the type of the element."""
TEXT_CLASS = 4
NUMBER_CLASSES = range(6, 16)
"""Classes of arrays of numbers; others are objects or sparse."""
CELL_CLASS = 1
STRUCT_CLASS = 2
MAX_DEPTH = 8  # of cells and structures in each other
COMPLEX = 0x0800  # flag of an array
MAX_AXES = 32


Arrays = dict[str, np.ndarray]
"""Arrays by name."""


class _Element(NamedTuple):
    kind: int
    content: memoryview


class _Array(NamedTuple):
    """The parts of an array; those behind the name follow in `parts`."""

    flags: int
    shape: tuple[int, ...]
    name: str
    parts: Iterator[_Element]


def read_mat_arrays(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Arrays of numbers and of text, by name; other values are left out.

    Fields of structures are `log.t`, cells `u.0`; equal parts of an array of structures
    or cells are one array, one row for each.

    A matrix of characters becomes an array of its rows.

    Raises:
        LogError: the file is of another version, damaged, or too large.
        OSError: it cannot be read.
    """
    content = _content(path)
    # mark of the byte order for NumPy
    head = content[:HEADER]
    if head.startswith(HDF5) or b"MATLAB 7.3" in head:
        raise LogError(
            f"{path} is a MAT file of version 7.3 (HDF5), which is not supported; "
            "save it with -v7 in MATLAB"
        )
    order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
    if order is None:
        raise LogError(
            f"{path} is not a MAT file of version 5; save it with -v7 in MATLAB"
        )
    arrays: dict[str, np.ndarray] = {}
    remaining = MAX_BYTES
    for element in _elements(memoryview(content)[HEADER:], order):
        if element.kind == COMPRESSED:
            unpacked = _unpacked(element.content, remaining, path)
            remaining -= len(unpacked)
            element = next(_elements(unpacked, order), element)
        if element.kind != MATRIX:
            continue
        found = _arrays_of(element.content, order)
        arrays |= {name: array for name, array in found.items() if name}
        if len(arrays) > MAX_COLUMNS:
            raise LogError(f"it holds more than {MAX_COLUMNS} arrays; save fewer")
    return arrays


def _content(path: str | os.PathLike) -> bytes:
    with Path(path).open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise LogError(f"{path} has more than {MAX_BYTES} bytes; save fewer rows")
    return content


def _elements(content: memoryview, order: str) -> Iterator[_Element]:
    """Yield the elements that follow each other.

    Raises:
        ValueError: the size of one is more than what is there.
    """
    place = 0
    while place + 8 <= len(content):
        kind = _integers(content[place : place + 4], "u4", order)[0]
        small = kind >> 16
        if small:  # of at most four bytes, which stand in the tag
            kind = kind & 0xFFFF
            size = small
            begin = place + 4
            following = place + 8
        else:
            size = _integers(content[place + 4 : place + 8], "u4", order)[0]
            begin = place + 8
            padding = 0 if kind == COMPRESSED else -size % 8
            following = begin + size + padding
        if small > 4 or size > len(content) - begin:
            raise ValueError(f"an element of {size} bytes is cut off")
        yield _Element(kind, content[begin : begin + size])
        place = following


def _unpacked(content: memoryview, limit: int, path: str | os.PathLike) -> memoryview:
    """A compressed element, of at most so many bytes."""
    unpacker = zlib.decompressobj()
    unpacked = unpacker.decompress(content, limit + 1)
    if len(unpacked) > limit:
        raise LogError(
            f"{path} unpacks to more than {MAX_BYTES} bytes; save fewer rows"
        )
    if not unpacker.eof:
        raise ValueError("a compressed element is cut off")
    return memoryview(unpacked)


def _arrays_of(
    content: memoryview,
    order: str,
    depth: int = 0,
) -> Arrays:
    """Numbers and texts of an array by name; its own name is that of its file.

    Parts of structures and cells follow after the name and a dot. Values of other
    classes are left out.

    Raises:
        ValueError: it is damaged.
    """
    if not content:  # an empty cell
        return {}
    array = _parts_of(content, order)
    kind = array.flags & 0xFF
    if array.name.startswith("__"):
        return {}
    if kind in (CELL_CLASS, STRUCT_CLASS):
        # arrays within a structure or a cell
        if depth >= MAX_DEPTH:
            raise ValueError(
                f"structures and cells are nested more than {MAX_DEPTH} deep"
            )
        fields = [""]
        if array.flags & 0xFF == STRUCT_CLASS:
            fields = _field_names(array, order)
        count = math.prod(array.shape)
        entries: dict[str, list[Arrays]] = {field: [] for field in fields}
        for _ in range(count):
            for field in fields:
                element = next(array.parts, None)
                if element is None or element.kind != MATRIX:
                    raise ValueError(f"'{array.name}' is cut off")
                entries[field].append(_arrays_of(element.content, order, depth + 1))
        arrays: Arrays = {}
        for field, parts in entries.items():
            name = _joined(array.name, field)
            if field and count == 1:
                arrays |= _named(name, parts[0])
            else:
                arrays |= _combined(name, parts)
        return arrays
    if kind == TEXT_CLASS:
        text = _text(next(array.parts, None), array.shape, order)
        return {array.name: text}
    if kind not in NUMBER_CLASSES or array.flags & COMPLEX:
        return {}
    return {array.name: _numbers(array, order)}


def _numbers(array: _Array, order: str) -> np.ndarray:
    """Numbers of an array."""
    element = next(array.parts, None)
    if element is None or element.kind not in NUMBERS:
        raise ValueError(f"the array '{array.name}' holds no numbers")
    dtype = np.dtype(order + NUMBERS[element.kind])
    if len(element.content) != math.prod(array.shape) * dtype.itemsize:
        raise ValueError(
            f"the array '{array.name}' of shape {array.shape} holds "
            f"{len(element.content)} bytes"
        )
    values = np.frombuffer(element.content, dtype)
    values = values.reshape(array.shape, order="F")
    return values.astype(dtype.newbyteorder("="))


def _field_names(array: _Array, order: str) -> list[str]:
    """Names of the fields of a structure, all of them padded to one length."""
    size = next(array.parts, None)
    names = next(array.parts, None)
    if size is None or names is None or size.kind != INT32:
        raise ValueError(f"the structure '{array.name}' has no names of fields")
    length = sum(_integers(size.content, "i4", order))
    if length < 1 or len(names.content) // length > MAX_COLUMNS:
        raise ValueError(f"the structure '{array.name}' has wrong names of fields")
    text = bytes(names.content).decode("latin-1")
    padded = [text[begin : begin + length] for begin in range(0, len(text), length)]
    return [name.partition("\0")[0] for name in padded]


def _named(name: str, arrays: Arrays) -> Arrays:
    """The same arrays as parts of a name."""
    return {_joined(name, part): array for part, array in arrays.items()}


def _joined(name: str, part: str) -> str:
    """A name with a dot before its part; either may be empty."""
    if name and part:
        return f"{name}.{part}"
    return name or part


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


def _parts_of(content: memoryview, order: str) -> _Array:
    parts = _elements(content, order)
    flags = next(parts, None)
    shape = next(parts, None)
    name = next(parts, None)
    if flags is None or shape is None or name is None:
        raise ValueError("an array is cut off")
    if flags.kind != UINT32 or len(flags.content) != 8 or shape.kind != INT32:
        raise ValueError("an array has no flags or no shape")
    sizes = _integers(shape.content, "i4", order)
    if not 2 <= len(sizes) <= MAX_AXES or min(sizes) < 0:
        raise ValueError(f"an array of shape {sizes[:MAX_AXES]}")
    text = bytes(name.content).decode("latin-1")
    return _Array(_integers(flags.content, "u4", order)[0], sizes, text, parts)


def _text(element: _Element | None, shape: tuple[int, ...], order: str) -> np.ndarray:
    """The rows of a matrix of characters."""
    if element is None or element.kind not in TEXTS:
        raise ValueError("a text holds no characters")
    encoding = TEXTS[element.kind]
    if encoding == "utf-16":
        encoding = "utf-16-le" if order == "<" else "utf-16-be"
    letters = bytes(element.content).decode(encoding)
    if len(letters) != math.prod(shape):
        raise ValueError(f"a text of shape {shape} holds {len(letters)} characters")
    if len(shape) != 2 or not letters:
        return np.array([letters])
    rows = shape[0]
    if rows > MAX_ROWS:
        raise LogError(
            f"a text has {rows} rows; at most {MAX_ROWS} are read. Split the file"
        )
    return np.array([letters[row::rows] for row in range(rows)])


def _integers(content: memoryview, kind: str, order: str) -> tuple[int, ...]:
    if len(content) % np.dtype(kind).itemsize:
        raise ValueError("a number is cut off")
    return tuple(np.frombuffer(content, order + kind).tolist())
