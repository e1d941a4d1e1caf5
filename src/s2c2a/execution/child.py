"""Starts of processes: none imports what lies in the current folder.

Programs that read files of strangers in native code run as bare files: a damaged file can
end such a process, or fill its memory; it cannot harm this one.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess

SAFE_PATH = "PYTHONSAFEPATH"
"""Variable that keeps the current folder and that of the program off Python's path."""


def child_command(*program: str) -> list[str]:
    """Command that runs a file as a program, or a module after "-m"."""
    return [sys.executable, "-P", *program]


@contextmanager
def safe_path() -> Iterator[None]:
    """Processes that Python's own library starts in this block have a safe path.

    It starts them by `-c`, which puts the current folder first: a file `signal.py` there
    would run in place of that of Python.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        del os.environ[SAFE_PATH]
        if before is not None:
            os.environ[SAFE_PATH] = before


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


def limit_memory(size: int) -> None:
    """Let this process allocate at most so many bytes, and leave no core dump."""
    with suppress(ImportError, ValueError, OSError):  # not on every system
        import resource  # noqa: PLC0415  # of POSIX alone

        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
