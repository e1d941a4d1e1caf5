"""Programs that read files of strangers, in processes of their own.

A damaged file can end such a process, and a small one can unpack to more than the memory
or the disk holds; it cannot harm this one.
"""

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from s2c2a.files.text import MAX_BYTES

PATIENCE = 600.0  # s; the largest bag takes some minutes


class ChildError(Exception):
    """A program did not read its file; the message says why."""


def child_command(file: str, *arguments: str) -> list[str]:
    """Command that runs a file as a program; packages around it are not imported."""
    # -P: no module is imported from the current folder or that of the program
    return [sys.executable, "-P", file, *arguments]


def arrays_of_child(file: str, *arguments: str, request: str = "") -> list[np.ndarray]:
    """Run a program that reads a file, and return its arrays.

    Args:
        file: the program; its last argument is the NPZ file that it writes.
        arguments: further ones, before that.
        request: what it finds in its standard input.

    Raises:
        ChildError: it failed, took too long, or needed too much memory.
    """
    # temporary files of a killed program go with the folder
    with TemporaryDirectory() as folder:
        out = Path(folder, "arrays.npz")
        try:
            done = subprocess.run(
                child_command(file, *arguments, str(out)),
                input=request,
                capture_output=True,
                timeout=PATIENCE,
                encoding="utf-8",
                errors="backslashreplace",
                # each thread of BLAS would reserve memory, which is limited
                env=os.environ
                | {"OPENBLAS_NUM_THREADS": "1", "PYTHONUTF8": "1", "TMPDIR": folder},
            )
        except subprocess.TimeoutExpired:
            raise ChildError(
                f"it takes more than {PATIENCE:g} s; give a smaller one"
            ) from None
        if done.returncode == 0:
            with np.load(out, allow_pickle=False) as arrays:
                return list(arrays.values())
    reasons = done.stderr.strip().splitlines()
    if done.returncode < 0 or not reasons:
        raise ChildError(
            "its reader crashed: it is damaged, or unpacks to too much; make it anew"
        )
    if "MemoryError" in reasons[-1]:
        raise ChildError(
            "it unpacks to more memory than a file may take; give a smaller one"
        )
    raise ChildError(reasons[-1])


def limit_memory(size: int = 3 * MAX_BYTES) -> None:
    """Let this process allocate at most so many bytes, and write no larger files or dumps.

    By default they suffice for the content of a file, and copies in other forms.
    """
    with suppress(ImportError, ValueError, OSError):  # not on every system
        import resource  # noqa: PLC0415  # of POSIX alone

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_FSIZE, (MAX_BYTES, MAX_BYTES))
        resource.setrlimit(resource.RLIMIT_AS, (size, size))
