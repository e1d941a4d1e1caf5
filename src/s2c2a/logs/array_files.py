"""NPZ and MAT files as named columns; pickled objects are never loaded."""

import os
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any, BinaryIO

import numpy as np
from scipy.io import loadmat

from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, LogError

HDF5 = b"\x89HDF\r\n\x1a\n"
COMPRESSED = 15  # type of a compressed element in a MAT file
BLOCK = 1 << 20  # bytes


def read_npz(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Columns of an NPZ file.

    The columns of an array with several axes are named `name.0`, `name.1`, and so on.

    Raises:
        LogError: the file is not an NPZ file, is too large, or holds objects.
    """
    try:
        with zipfile.ZipFile(path) as file:
            sizes = [entry.file_size for entry in file.infolist()]
            if sum(sizes) > MAX_BYTES or len(sizes) > MAX_COLUMNS:
                raise LogError(
                    f"{path} unpacks to {len(sizes)} arrays of {sum(sizes)} bytes; "
                    f"at most {MAX_COLUMNS} arrays and {MAX_BYTES} bytes are read"
                )
        with np.load(path, allow_pickle=False) as arrays:
            return _split_columns({name: arrays[name] for name in arrays.files})
    except LogError:
        raise
    except Exception as error:  # an untrusted file may raise any error
        raise LogError(
            f"{path} cannot be read as NPZ: {error}; save plain arrays of numbers"
        ) from error


def read_mat(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Columns of a MAT file of version 5, named as in `read_npz`.

    Raises:
        LogError: the file does not exist, is of version 7.3 (HDF5), or is too large.
    """
    try:
        with open(path, "rb") as file:
            _check_mat(file, path)
        arrays = loadmat(path)
        names = [name for name in arrays if not name.startswith("__")]
        return _split_columns({name: arrays[name] for name in names})
    except LogError:
        raise
    except Exception as error:  # an untrusted file may raise any error
        raise LogError(
            f"{path} cannot be read as MAT: {error}; "
            "save plain arrays of numbers with -v7"
        ) from error


def _check_mat(file: BinaryIO, path: str | os.PathLike) -> None:
    """Refuse HDF5 files, and files whose elements unpack beyond the size limit."""
    head = file.read(128)
    if head.startswith(HDF5) or b"MATLAB 7.3" in head:
        raise LogError(
            f"{path} is a MAT file of version 7.3 (HDF5), which is not supported; "
            "save it with -v7 in MATLAB"
        )
    mark = head[126:128]
    if mark not in (b"IM", b"MI"):
        raise LogError(
            f"{path} is not a MAT file of version 5; save it with -v7 in MATLAB"
        )
    order = "little" if mark == b"IM" else "big"
    remaining = MAX_BYTES
    while len(tag := file.read(8)) == 8:
        kind = int.from_bytes(tag[:4], order)  # type: ignore[arg-type]
        size = int.from_bytes(tag[4:], order)  # type: ignore[arg-type]
        if kind == COMPRESSED:
            remaining -= _unpacked_size(file, size, remaining)
        else:
            remaining -= size
        if remaining < 0:
            raise LogError(
                f"{path} unpacks to more than {MAX_BYTES} bytes; save fewer rows"
            )
        if kind != COMPRESSED:
            file.seek(size, os.SEEK_CUR)


def _unpacked_size(file: BinaryIO, size: int, limit: int) -> int:
    """Unpacked bytes of an element, counted until they exceed the limit."""
    unpacker = zlib.decompressobj()
    total = 0
    while size > 0:
        block = file.read(min(size, BLOCK))
        if not block:
            break
        size -= len(block)
        while block and total <= limit:
            total += len(unpacker.decompress(block, BLOCK))
            block = unpacker.unconsumed_tail
    return total


def _split_columns(arrays: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """One column for each one-dimensional array or column of a larger one."""
    columns: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        array = np.asarray(array)
        # structures, cells, and objects are skipped
        if array.dtype.kind not in "fiubU":
            continue
        if array.ndim == 2 and 1 in array.shape:
            array = array.reshape(-1)
        if array.ndim == 1:
            columns[name] = array
            continue
        flat = array.reshape(len(array), -1) if array.ndim else array.reshape(1, 1)
        count = flat.shape[1]
        if len(columns) + count > MAX_COLUMNS:
            raise LogError(
                f"'{name}' has {count} columns; at most {MAX_COLUMNS} are read. "
                "Save arrays with one row per sample"
            )
        columns |= {f"{name}.{index}": flat[:, index] for index in range(count)}
    return columns
