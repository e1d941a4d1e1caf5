"""MAT files of versions 4 to 7: arrays of numbers and text.

SciPy reads them in native code, in a process of its own (`mat_program`).
"""

import io
import os
import subprocess
from pathlib import Path

import numpy as np

from s2c2a.execution.child import child_command
from s2c2a.logs.errors import MAX_BYTES, LogError

HDF5 = b"\x89HDF\r\n\x1a\n"
HEADER = 128  # bytes; text that names the version
PROGRAM = str(Path(__file__).with_name("mat_program.py"))
PATIENCE = 60.0  # s; the largest log takes a few


def read_mat_arrays(path: str | os.PathLike) -> dict[str, np.ndarray]:
    """Arrays of numbers and of text, by name; other values are left out.

    Fields of structures are `log.t`, cells `u.0`; equal parts of an array of structures
    or cells are one array, one row for each.

    A matrix of characters becomes an array of its rows.

    Raises:
        LogError: the file is of another version, damaged, or too large.
        OSError: it cannot be read.
    """
    with Path(path).open("rb") as file:
        head = file.read(HEADER)
        size = os.fstat(file.fileno()).st_size
    if size > MAX_BYTES:
        raise LogError(f"{path} has more than {MAX_BYTES} bytes; save fewer rows")
    if head.startswith(HDF5) or b"MATLAB 7.3" in head:
        raise LogError(
            f"{path} is a MAT file of version 7.3 (HDF5), which is not supported; "
            "save it with -v7 in MATLAB"
        )
    program = child_command(PROGRAM, os.path.abspath(path))
    try:
        done = subprocess.run(
            [*program, str(MAX_BYTES)],
            stdin=subprocess.DEVNULL,
            # each thread of its own would reserve memory, which is limited
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            capture_output=True,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        raise ValueError(f"SciPy needs more than {PATIENCE:g} s") from None
    if done.returncode:
        reasons = done.stderr.decode(errors="replace").strip().splitlines()
        raise ValueError(reasons[-1] if reasons else "it is damaged")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as parts:
        names = parts["names"].tolist()
        return {name: parts[f"arr_{place}"] for place, name in enumerate(names)}
