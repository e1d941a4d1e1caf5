"""Programs that read files of strangers in native code, in processes of their own.

A damaged file can end such a process, or fill its memory; it cannot harm this one.
"""

import sys
from contextlib import suppress


def child_command(module: str, *arguments: str) -> list[str]:
    """Command that runs a module of the package as a program."""
    # -P: no module is imported from the current folder
    return [sys.executable, "-P", "-m", module, *arguments]


def limit_memory(size: int) -> None:
    """Let this process allocate at most so many bytes, and leave no core dump."""
    with suppress(ImportError, ValueError, OSError):  # not on every system
        import resource  # noqa: PLC0415  # of POSIX alone

        resource.setrlimit(resource.RLIMIT_AS, (size, size))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
