"""A small file of a stranger takes neither the memory nor the disk, whatever its form."""

import gzip
import io
import os
import zipfile

import numpy as np
import pytest

from s2c2a.logs.errors import LogError
from s2c2a.logs.reading import read_table
from s2c2a.logs.tables import ColumnRequest

zstandard = pytest.importorskip("zstandard")
writing = pytest.importorskip("mcap.writer")

MANY = 4_000_000_000  # bytes
BAG = """rosbag2_bagfile_information:
  {version: 5, storage_identifier: sqlite3, duration: {nanoseconds: 1},
   starting_time: {nanoseconds_since_epoch: 0}, message_count: 0,
   topics_with_message_count: [], compression_format: zstd, compression_mode: FILE,
   relative_file_paths: [x.db3.zstd]}
"""


def zeros(size: int) -> bytes:
    """Compressed zeros."""
    content = io.BytesIO()
    with zstandard.ZstdCompressor().stream_writer(content, closefd=False) as packed:
        for _ in range(size // 1_000_000):
            packed.write(bytes(1_000_000))
    return content.getvalue()


def bag(folder):
    (folder / "bag").mkdir()
    (folder / "bag" / "metadata.yaml").write_text(BAG)
    (folder / "bag" / "x.db3.zstd").write_bytes(zeros(500_000_000))
    return folder / "bag"


def mcap(folder):
    """A chunk that claims, and holds, more than the memory."""
    with open(folder / "x.mcap", "wb") as file:
        out = writing.Writer(file)
        out.start()
        chunk = writing.Chunk("zstd", zeros(MANY), 0, 0, 0, MANY)
        record = writing.RecordBuilder()
        chunk.write(record)
        file.write(record.end())
    return folder / "x.mcap"


def npz(folder):
    """An array that claims more than the file holds."""
    head = io.BytesIO()
    claim = {"descr": "<f8", "fortran_order": False, "shape": (MANY // 8,)}
    np.lib.format.write_array_header_1_0(head, claim)
    with zipfile.ZipFile(folder / "x.npz", "w") as file:
        file.writestr("a.npy", head.getvalue())
    return folder / "x.npz"


def text(folder):
    (folder / "x.csv.gz").write_bytes(gzip.compress(b"a,b\n" + bytes(500_000_000), 1))
    return folder / "x.csv.gz"


@pytest.mark.parametrize("make", [bag, mcap, npz, text])
def test_what_unpacks_beyond_the_bound_is_refused(tmp_path, make):
    with pytest.raises(LogError, match=r"unpacks to more|has more than"):
        read_table(make(tmp_path), ColumnRequest(["a"]))


@pytest.mark.parametrize("name", ["x.csv", "x.mcap", "bag/x.db3", "x.npz", "x.xlsx"])
def test_a_pipe_is_no_log(tmp_path, name):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    os.mkfifo(path)
    given = path.parent if name.startswith("bag") else path
    with pytest.raises(LogError, match=f"{path} is not a regular file"):
        read_table(given, ColumnRequest(["a"]))
