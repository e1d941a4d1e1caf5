"""MAT files: read as SciPy reads them, and never a crash, whatever byte is wrong."""

import io
import struct
import zlib
from contextlib import suppress

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from s2c2a.logs.errors import LogError
from s2c2a.logs.mat_files import read_mat_arrays
from s2c2a.logs.reading import read_table
from s2c2a.logs.tables import ColumnRequest

ANY = ColumnRequest(["a"])
DTYPES = ["f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "?"]
VALUES = {kind: np.arange(12).reshape(2, 3, 2).astype(kind) for kind in DTYPES}


def mat(values: dict, **options) -> bytes:
    content = io.BytesIO()
    savemat(content, values, **options)
    return content.getvalue()


@pytest.mark.parametrize("is_compressed", [False, True])
def test_arrays_are_those_that_scipy_reads(written, is_compressed):
    values = {f"of_{kind.replace('?', 'b')}": array for kind, array in VALUES.items()}
    values |= {
        "a": 3.5,
        "none": np.zeros((0, 3)),
        "text": "up",
        "rows": np.array(["up", "down"]),
        "accents": "Länge",
        "cell": np.array([1, "x"], object),
        "struct": {"a": 1},
        "complex": np.array([1j]),
    }
    path = written(mat(values, do_compression=is_compressed), "log.mat")
    ours = read_mat_arrays(path)
    theirs = loadmat(path)
    assert set(values) - set(ours) == {"cell", "struct", "complex"}
    assert set(ours) - set(values) == {"cell.0", "cell.1", "struct.a"}
    for name in set(ours) & set(values):
        array = ours[name]
        expected = theirs[name]
        if array.dtype.kind == "U":
            expected = np.char.strip(expected)
            array = np.char.strip(array)
        np.testing.assert_array_equal(array, expected)


def test_a_file_of_a_big_endian_computer_is_read(written):
    def element(kind: int, content: bytes) -> bytes:
        padding = b"\0" * (-len(content) % 8)
        return struct.pack(">II", kind, len(content)) + content + padding

    array = (
        element(6, struct.pack(">II", 6, 0))
        + element(5, struct.pack(">ii", 1, 2))
        + element(1, b"a")
        + element(9, struct.pack(">dd", 1.5, -2.0))
    )
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(">H", 0x0100) + b"MI"
    path = written(head + element(14, array), "log.mat")
    np.testing.assert_array_equal(read_table(path, ANY).numbers["a"], [1.5, -2.0])


SMALL = mat({"a": np.arange(3.0), "t": "up", "s": {"c": np.array([1, "x"], object)}})
PACKED = mat({"a": np.arange(3.0), "t": "up"}, do_compression=True)


@pytest.mark.parametrize("whole", [SMALL, PACKED])
def test_no_byte_can_end_the_process(written, whole):
    """SciPy's reader ends with a segmentation fault for some of these files."""
    for place in range(128, len(whole), 60):
        with suppress(LogError):  # any other error fails
            read_table(written(whole[:place], "log.mat"), ANY)


def test_a_file_that_ends_the_program_is_damaged(written):
    damaged = bytearray(mat({"a": np.arange(3.0)}))
    place = damaged.rindex(struct.pack("<II", 9, 24))
    damaged[place] = 0  # the type of the numbers
    with pytest.raises(LogError, match=r"log\.mat.*it is damaged"):
        read_table(written(bytes(damaged), "log.mat"), ANY)


def test_a_small_file_cannot_fill_the_memory(written):
    size = 4_160_000_000  # bytes of an array, as the file says
    head = struct.pack("<IIII", 6, 8, 6, 0)
    head += struct.pack("<IIii", 5, 8, size // 8, 1) + struct.pack("<HH4s", 1, 1, b"a")
    head += struct.pack("<II", 9, size)
    content = zlib.compress(struct.pack("<II", 14, len(head) + size) + head + bytes(99))
    whole = SMALL[:128] + struct.pack("<II", 15, len(content)) + content
    with pytest.raises(LogError, match="unpacks to more memory than a file may take"):
        read_table(written(whole, "log.mat"), ANY)


def test_structures_and_cells_are_columns_with_dots(written):
    cell = np.empty(3, object)
    cell[:] = [np.arange(5.0) + index for index in range(3)]
    samples = np.array(
        [(k, [k, 2 * k]) for k in range(5)], dtype=[("t", object), ("p", object)]
    )
    scalars = np.array([1.0, 2.0, 3.0, 4.0, 5.0], object)
    log = {"t": np.arange(5.0), "u": np.arange(10.0).reshape(5, 2), "deep": {"c": cell}}
    content = mat({"log": log, "s": samples, "n": scalars}, do_compression=True)
    names = ["log.t", "log.u.1", "log.deep.c.2", "s.t", "s.p.1", "n"]
    path = written(content, "log.mat")
    numbers = read_table(path, ColumnRequest(names)).numbers
    count = np.arange(5.0)
    expected = [count, 2 * count + 1, count + 2, count, 2 * count, count + 1]
    for name, values in zip(names, expected, strict=True):
        np.testing.assert_array_equal(numbers[name], values)


def test_deep_nests_are_refused(written):
    value = {"a": 1.0}
    for _ in range(9):
        value = {"a": value}
    with pytest.raises(LogError, match="nested more than 8 deep"):
        read_table(written(mat({"log": value}), "log.mat"), ANY)
