"""The machine that measures: what it is, how busy it is, how much memory a process takes, one core or several."""

import os
import platform
import resource
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from s2c2a.shards import all_cores

MIB = 2**20
EXTRAS = ("torch", "pyelastica", "numba")
"""What is compared with; the extra `bench` brings it."""


def describe() -> dict[str, Any]:
    """Processor, cores, memory, system, and the load before anything was measured."""
    return {
        "processor": _processor(),
        "cores": all_cores(),
        "memory_MiB": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / MIB),
        "system": platform.platform(),
        "load_average": os.getloadavg()[0],
    }


def extra_versions() -> dict[str, str]:
    """Versions of what is compared with, as far as it is installed."""
    found = {}
    for name in EXTRAS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def keep_to(cores: int) -> None:
    """Keep this process, and all that it starts, to so many cores; where the system cannot, to so many threads.

    Call it before JAX, PyTorch or NumPy start their threads.
    """
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-cores:])
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = str(min(cores, all_cores()))


def peak_memory() -> float:
    """Most memory that this process has held [MiB].

    Linux counts the memory of whoever started a process in `ru_maxrss`, so there its own high-water mark is read.
    """
    told = Path("/proc/self/status")
    lines = told.read_text(encoding="ascii", errors="replace").splitlines() if told.is_file() else []
    marks = [line.split()[1] for line in lines if line.startswith("VmHWM:")]
    return int(marks[0]) / 1024 if marks else mebibytes(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)


def mebibytes(ru_maxrss: int) -> float:
    """Most memory held [MiB], from what the system says of it, which is in bytes or kibibytes."""
    return ru_maxrss / (MIB if sys.platform == "darwin" else 1024)


def resident_memory() -> float | None:
    """Memory that this process holds now [MiB]; None where the system does not tell."""
    counts = Path("/proc/self/statm")
    if not counts.is_file():
        return None
    return int(counts.read_text(encoding="ascii").split()[1]) * resource.getpagesize() / MIB


def _processor() -> str:
    told = Path("/proc/cpuinfo")
    lines = told.read_text(encoding="utf-8").splitlines() if told.is_file() else []
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor()
    )
