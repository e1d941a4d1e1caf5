"""Programs that read files of strangers in native code, in processes of their own.

A damaged file can end such a process, or fill its memory; it cannot harm this one.
"""

import sys
from contextlib import suppress


def child_command(file: str, *arguments: str) -> list[str]:
    """Command that runs a file as a program; packages around it are not imported."""
    # -P: no module is imported from the current folder or that of the program
    return [sys.executable, "-P", file, *arguments]


def limit_memory(size: int) -> None:
    """Let this process allocate at most so many bytes, and leave no core dump."""
    with suppress(ImportError, ValueError, OSError):  # not on every system
        import resource  # noqa: PLC0415  # of POSIX alone

        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
