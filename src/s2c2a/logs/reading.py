"""Forms of logs: which reader reads which file, and what to do with others."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from s2c2a.logs.array_files import read_mat, read_npz
from s2c2a.logs.bags import read_bag
from s2c2a.logs.errors import LogError
from s2c2a.logs.json_lines import read_json_lines
from s2c2a.logs.lerobot_folders import is_lerobot, read_lerobot
from s2c2a.logs.mcap_files import read_mcap
from s2c2a.logs.parquet_files import read_parquet
from s2c2a.logs.sheet_files import read_xlsx
from s2c2a.logs.tables import ColumnRequest, Table
from s2c2a.logs.text_files import read_text_file

Reader = Callable[[str | os.PathLike, ColumnRequest], Table]


@dataclass(frozen=True)
class Form:
    """Form of a log.

    Attributes:
        name: its name.
        endings: endings of its files.
        read: its reader.
    """

    name: str
    endings: tuple[str, ...]
    read: Reader


FORMS = (
    Form("NPZ", (".npz",), read_npz),
    Form("MAT", (".mat",), read_mat),
    Form("Parquet", (".parquet", ".pq"), read_parquet),
    Form("XLSX", (".xlsx", ".xlsm"), read_xlsx),
    Form("JSON lines", (".jsonl", ".ndjson", ".json"), read_json_lines),
    Form("bag", (".bag", ".db3"), read_bag),
    Form("MCAP", (".mcap",), read_mcap),
)
"""Forms that endings show; a folder is a LeRobotDataset or a bag, and every
other file delimited text."""
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


def read_table(path: str | os.PathLike, request: ColumnRequest) -> Table:
    """Read those requested columns that a file has.

    Args:
        path: file of one of the forms, recognized by its ending, or delimited text;
            text may be gzipped.
        request: columns to read.

    Raises:
        LogError: the file cannot be read or is too large, or a row is cut off or holds
            text in a numeric column.
    """
    # ending of a file, of the packed one if it is gzipped
    file = Path(path)
    if file.suffix.lower() == ".gz":
        file = file.with_suffix("")
    ending = file.suffix.lower()
    if way_out := WAYS_OUT.get(ending):
        raise LogError(f"{path} cannot be read. {way_out}")
    if not Path(path).exists():
        raise LogError(f"{path} does not exist; check the path of the log")
    if Path(path).is_dir():
        read = read_lerobot if is_lerobot(path) else read_bag
        return read(path, request)
    for form in FORMS:
        if ending in form.endings:
            return form.read(path, request)
    return read_text_file(path, request)
