"""Starts of processes: none imports what lies in the current folder.

Programs that read files of strangers have one of their own: a damaged file can end it, and
a small one can unpack to more than the memory or the disk holds; it cannot harm this one.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import BadZipFile

import numpy as np

from s2c2a.files.text import MAX_BYTES

SAFE_PATH = "PYTHONSAFEPATH"
"""Variable that keeps the current folder and that of the program off Python's path."""
_OURS = "of s2c2a"  # any text but an empty one means yes
_LOCK = threading.Lock()
_open_blocks: set[object] = set()  # of all threads, as the environment
PATIENCE = 600.0  # s; the largest bag takes some minutes
MAX_SAID = 2000  # bytes of an error's text


class ChildError(Exception):
    """A program did not read its file; the message says why."""


def child_command(*program: str) -> list[str]:
    """Command that runs a file as a program, or a module after "-m"."""
    return [sys.executable, "-P", *program]


@contextmanager
def safe_path() -> Iterator[None]:
    """Processes that Python's own library starts in this block have a safe path.

    It starts them by `-c`, which puts the current folder first: a file `signal.py` there
    would run in place of that of Python.
    """
    block = object()
    with _LOCK:
        _open_blocks.add(block)
        os.environ[SAFE_PATH] = os.environ.get(SAFE_PATH) or _OURS  # empty means no
    try:
        yield
    finally:
        with _LOCK:
            _open_blocks.discard(block)
            if not _open_blocks and os.environ.get(SAFE_PATH) == _OURS:
                del os.environ[SAFE_PATH]


class _SafeProcess(SpawnProcess):
    @staticmethod
    def _Popen(process_obj):  # noqa: N802  # name of the library
        with safe_path():
            return SpawnProcess._Popen(process_obj)


class _SafeSpawn(SpawnContext):
    Process = _SafeProcess


def spawning() -> SpawnContext:
    """Context of `multiprocessing` whose processes have a safe path.

    They are new ones: forking a process that has threads, as JAX's has, can hang.
    """
    if os.name == "posix":  # a process that the first lock would start
        with safe_path():
            resource_tracker.ensure_running()
    return _SafeSpawn()


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
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory())
        out = Path(folder, "arrays.npz")
        said = stack.enter_context(open(Path(folder, "said"), "w+b"))
        try:
            done = subprocess.run(
                child_command(file, *arguments, str(out)),
                input=request,
                stdout=subprocess.DEVNULL,
                stderr=said,
                timeout=PATIENCE,
                encoding="utf-8",
                # each thread of BLAS would reserve memory, which is limited
                env=os.environ
                | {"OPENBLAS_NUM_THREADS": "1", "PYTHONUTF8": "1", "TMPDIR": folder},
            )
        except subprocess.TimeoutExpired:
            raise ChildError(
                f"it takes more than {PATIENCE:g} s; give a smaller one"
            ) from None
        if done.returncode == 0:
            with (
                suppress(OSError, ValueError, BadZipFile),  # it wrote something else
                np.load(out, allow_pickle=False) as arrays,
            ):
                return list(arrays.values())
        said.seek(max(0, said.seek(0, os.SEEK_END) - MAX_SAID))
        text = said.read().decode(errors="backslashreplace")
    reasons = ["".join(filter(str.isprintable, line)) for line in text.splitlines()]
    if done.returncode <= 0 or not reasons or "MemoryError" in reasons[-1]:
        raise ChildError(
            "it is damaged, or unpacks to more memory than a file may take; make it "
            "anew, or smaller"
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
