"""Forms of logs: which reader reads which file, and what to do with others."""

import json
import os
from collections.abc import Callable
from pathlib import Path

from s2c2a.execution.child import ChildError, arrays_of_child
from s2c2a.logs.array_files import read_mat, read_npz
from s2c2a.logs.bags import read_bag
from s2c2a.logs.errors import MAX_BYTES, LogError
from s2c2a.logs.json_lines import read_json_lines
from s2c2a.logs.lerobot_folders import is_lerobot, read_lerobot
from s2c2a.logs.mcap_files import read_mcap
from s2c2a.logs.parquet_files import read_parquet
from s2c2a.logs.sheet_files import read_xlsx
from s2c2a.logs.tables import ColumnRequest, Table, unpack_table
from s2c2a.logs.text_files import read_text_file

PROGRAM = str(Path(__file__).with_name("table_program.py"))
Reader = Callable[[str | os.PathLike, ColumnRequest], Table]

READERS: dict[str, Reader] = {
    ".npz": read_npz,
    ".mat": read_mat,
    ".parquet": read_parquet,
    ".pq": read_parquet,
    ".xlsx": read_xlsx,
    ".xlsm": read_xlsx,
    ".jsonl": read_json_lines,
    ".ndjson": read_json_lines,
    ".json": read_json_lines,
    ".bag": read_bag,
    ".db3": read_bag,
    ".mcap": read_mcap,
}
"""Readers by ending; a folder is a LeRobotDataset or a bag, and every other file
delimited text."""
WAYS_OUT = {
    ".npy": "NPY: save named arrays with numpy.savez",
    ".h5": "HDF5: save the arrays as NPZ, with numpy.savez",
    ".hdf5": "HDF5: save the arrays as NPZ, with numpy.savez",
    ".hdf": "HDF5: save the arrays as NPZ, with numpy.savez",
    ".nc": "netCDF: save the arrays as NPZ, with numpy.savez",
    ".pt": "PyTorch: it could run code; save the arrays as NPZ, with numpy.savez",
    ".tdms": "TDMS: export as CSV from LabVIEW or DIAdem",
    ".pkl": "pickle: it could run code; save the arrays as NPZ, with numpy.savez",
    ".pickle": "pickle: it could run code; save the arrays as NPZ, with numpy.savez",
    ".xls": "XLS: export as CSV",
    ".ods": "ODS: export as CSV",
    ".trc": "TRC: export as CSV or TSV from the program of the motion capture",
    ".numbers": "Numbers: export as CSV",
    ".arrow": "Arrow: save it as CSV or Parquet",
    ".feather": "Feather: save it as CSV or Parquet",
    ".c3d": "C3D: export as CSV or TSV from the program of the motion capture",
    ".tak": "Motive take: export as CSV from Motive",
    ".qtm": "Qualisys measurement: export as TSV from Qualisys Track Manager",
    ".zip": "ZIP archive: unpack it, and give the files in it",
    ".ulg": "ULog: convert it to CSV with ulog2csv",
}
"""What is not read, by ending, and the way out."""


PLAIN = read_text_file, read_json_lines
"""Readers of text, which takes a few times the size of its file, if it is not gzipped."""


def read_table(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read those requested columns that a file has.

    What may unpack to more than its size is read by a program with limited memory.

    Args:
        path: file of one of the forms, recognized by its ending, or delimited text;
            text may be gzipped.
        request: columns to read.

    Raises:
        LogError: the file cannot be read or is too large, or a row is cut off or holds
            text in a numeric column.
    """
    if way_out := WAYS_OUT.get(_ending(path)):
        raise LogError(f"{path} cannot be read. {way_out}")
    _check_files(Path(path))
    if _reader(path) in PLAIN and Path(path).suffix.lower() != ".gz":
        return read_here(path, request)
    try:
        arrays = arrays_of_child(
            PROGRAM, str(path), request=json.dumps(vars(request), default=list)
        )
    except ChildError as error:
        named = "" if str(path) in str(error) else f"{path} cannot be read: "
        raise LogError(f"{named}{error}") from error
    return unpack_table(arrays)


def read_here(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read the columns in this process, whatever memory that takes."""
    return _reader(path)(path, request)


def _reader(path: str | os.PathLike) -> Reader:
    if Path(path).is_dir():
        return read_lerobot if is_lerobot(path) else read_bag
    return READERS.get(_ending(path), read_text_file)


def _ending(path: str | os.PathLike) -> str:
    """Ending of a file, of the packed one if it is gzipped."""
    file = Path(Path(path).name.lower().removesuffix(".gz"))
    return file.suffix


def _check_files(path: Path) -> None:
    """Refuse what is too large, and all but files: reading from a pipe never ends."""
    if not path.exists():
        raise LogError(f"{path} does not exist; check the path of the log")
    files = [path]
    if path.is_dir():
        files = [*path.iterdir(), *path.glob("data/*/*.parquet")]
    for file in files:
        if not file.is_file() and not file.is_dir():
            raise LogError(f"{file} is not a regular file; save the log as one")
        if file.is_file() and file.stat().st_size > MAX_BYTES:
            raise LogError(
                f"{file} has more than {MAX_BYTES} bytes; record the topics of the arm "
                "alone, or save fewer rows or columns"
            )
