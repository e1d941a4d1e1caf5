"""Logs in the containers of NumPy and MATLAB, as named columns; nothing in them is ever run."""

import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np

from s2c2a.logs.errors import MAX_BYTES, MAX_COLUMNS, LogError

HDF5 = b"\x89HDF\r\n\x1a\n"
COMPRESSED = 15  # kind of a packed element in a MAT file
PIECE = 1 << 20


def read_npz(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Columns of an NPZ file; of an array of more axes than one they are `name.0`, `name.1`, ...

    Raises:
        LogError: no NPZ, too large, or it holds objects.
    """
    try:
        with zipfile.ZipFile(path) as file:
            sizes = [entry.file_size for entry in file.infolist()]
            if sum(sizes) > MAX_BYTES or len(sizes) > MAX_COLUMNS:
                raise LogError(
                    f"{path} unpacks to {sum(sizes)} bytes; at most {MAX_BYTES} are read"
                )
        with np.load(path, allow_pickle=False) as arrays:
            return _columns({name: arrays[name] for name in arrays.files})
    except LogError:
        raise
    except Exception as error:  # whatever a stranger's file provokes
        raise LogError(
            f"{path}: cannot be read as NPZ: {error}; save plain arrays of numbers"
        ) from error


def read_mat(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Columns of a MAT file of version 5; named as of an NPZ.

    Raises:
        LogError: no such file, of version 7.3 (HDF5), or too large.
    """
    from scipy.io import loadmat

    try:
        with open(path, "rb") as file:
            _check_mat(file, path)
        return _columns(
            {
                name: array
                for name, array in loadmat(path).items()
                if not name.startswith("__")
            }
        )
    except LogError:
        raise
    except Exception as error:
        raise LogError(
            f"{path}: cannot be read as MAT: {error}; save plain arrays of numbers with -v7"
        ) from error


def _check_mat(file: BinaryIO, path: str | os.PathLike) -> None:
    """Refuse HDF5, and packed elements that swell: they are unpacked once without being kept."""
    head = file.read(128)
    if head.startswith(HDF5) or b"MATLAB 7.3" in head:
        raise LogError(
            f"{path} is of version 7.3 (HDF5), which is not read; save it with -v7 in MATLAB"
        )
    if len(head) < 128 or head[126:128] not in (b"IM", b"MI"):
        raise LogError(
            f"{path} is no MAT file of version 5; save it with -v7 in MATLAB"
        )
    order = "little" if head[126:128] == b"IM" else "big"
    left = MAX_BYTES
    while len(tag := file.read(8)) == 8:
        kind, size = (int.from_bytes(part, order) for part in (tag[:4], tag[4:]))  # type: ignore[arg-type]
        left -= _unpacked_size(file, size, left) if kind == COMPRESSED else size
        if left < 0:
            raise LogError(
                f"{path} unpacks to more than {MAX_BYTES} bytes; take a part of it"
            )
        if kind != COMPRESSED:
            file.seek(size, os.SEEK_CUR)


def _unpacked_size(file: BinaryIO, size: int, most: int) -> int:
    """Bytes of a packed element, not counted beyond `most`."""
    unpacker = zlib.decompressobj()
    total = 0
    for piece in _pieces(file, size):
        while piece and total <= most:
            total += len(unpacker.decompress(piece, PIECE))
            piece = unpacker.unconsumed_tail
    return total


def _pieces(file: BinaryIO, size: int) -> Iterator[bytes]:
    while size > 0 and (piece := file.read(min(size, PIECE))):
        size -= len(piece)
        yield piece


def _columns(arrays: Mapping[str, Any]) -> dict[str, np.ndarray]:
    columns: dict[str, np.ndarray] = {}
    for name, array in arrays.items():
        array = np.asarray(array)
        # structures, cells and objects are passed over; naming one says so
        if array.dtype.kind not in "fiubU":
            continue
        if array.ndim == 2 and 1 in array.shape:
            array = array.reshape(-1)
        if array.ndim == 1:
            columns[name] = array
            continue
        flat = array.reshape(len(array), -1) if array.ndim else array.reshape(1, 1)
        if len(columns) + flat.shape[1] > MAX_COLUMNS:
            raise LogError(
                f"'{name}' has {flat.shape[1]} columns, at most {MAX_COLUMNS} are read; rows are moments"
            )
        columns |= {
            f"{name}.{number}": flat[:, number] for number in range(flat.shape[1])
        }
    return columns
