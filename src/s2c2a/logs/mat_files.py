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
"""Classes of arrays of numbers; others are cells, structures, objects or sparse."""
COMPLEX = 0x0800  # flag of an array
MAX_AXES = 32


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

    A matrix of characters becomes an array of its rows.

    Raises:
        LogError: the file is of another version, damaged, or too large.
        OSError: it cannot be read.
    """
    content = _content(path)
    order = _byte_order(content, path)
    arrays: dict[str, np.ndarray] = {}
    remaining = MAX_BYTES
    for element in _elements(memoryview(content)[HEADER:], order):
        if element.kind == COMPRESSED:
            unpacked = _unpacked(element.content, remaining, path)
            remaining -= len(unpacked)
            element = next(_elements(unpacked, order), element)
        if element.kind != MATRIX:
            continue
        array = _array_of(element.content, order)
        if array is not None:
            arrays[array[0]] = array[1]
        if len(arrays) > MAX_COLUMNS:
            raise LogError(f"it holds more than {MAX_COLUMNS} arrays; save fewer")
    return arrays


def _content(path: str | os.PathLike) -> bytes:
    with Path(path).open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise LogError(f"{path} has more than {MAX_BYTES} bytes; save fewer rows")
    return content


def _byte_order(content: bytes, path: str | os.PathLike) -> str:
    """Mark of the byte order for NumPy.

    Raises:
        LogError: the file is of another version, or no MAT file.
    """
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
    return order


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


def _array_of(content: memoryview, order: str) -> tuple[str, np.ndarray] | None:
    """Name and values of an array; None for what is neither numbers nor text.

    Raises:
        ValueError: it is damaged.
    """
    if not content:  # an empty cell
        return None
    flags, shape, name, parts = _parts_of(content, order)
    kind = flags & 0xFF
    if not name or name.startswith("__"):
        return None
    if kind == TEXT_CLASS:
        return name, _text(next(parts, None), shape, order)
    if kind not in NUMBER_CLASSES or flags & COMPLEX:
        return None
    element = next(parts, None)
    if element is None or element.kind not in NUMBERS:
        raise ValueError(f"the array '{name}' holds no numbers")
    dtype = np.dtype(order + NUMBERS[element.kind])
    if len(element.content) != math.prod(shape) * dtype.itemsize:
        raise ValueError(
            f"the array '{name}' of shape {shape} holds {len(element.content)} bytes"
        )
    values = np.frombuffer(element.content, dtype).reshape(shape, order="F")
    return name, values.astype(dtype.newbyteorder("="))


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
