"""`s2c2a doctor`: what this machine has and lacks."""

import os
import platform
import shutil
import sys
from collections.abc import Callable

NEEDED = {
    "numpy": "everything",
    "pydantic": "arm files",
    "mujoco": "simulation",
    "jax": "networks, planning",
    "equinox": "networks",
    "optax": "training, planning",
    "safetensors": "strategies",
    "scipy": "tasks, reference",
    "matplotlib": "figures",
}
EXTRAS = {
    "viser": "live page (extra live)",
    "distributed": "clusters (extra cluster)",
    "optuna": "sweeps (extra sweep)",
    "pytest-benchmark": "benchmarks (extra bench)",
    "torch": "comparisons of benchmarks (extra bench)",
    "pyelastica": "comparisons of benchmarks (extra bench)",
}


def doctor() -> None:
    """Say what this machine has and lacks, and how to get what is missing."""
    from s2c2a.cli.console import print_table

    checks = [_python(), _cores(), *_packages(), *_programs()]
    complete = not _faults(checks)
    if complete:
        tried = {"simulated arm": _simulation, "JAX device": _numerics, "cache folder": _cache}
        checks += [_tried(check, what) for what, check in tried.items()]
    print_table("What this machine has", ("what", "found", "good for"), checks)
    if faults := _faults(checks):
        advice = "look at the message above" if complete else "install the package again with `pip install .`"
        print(f"not well: {', '.join(faults)}; {advice}")
        sys.exit(1)


def _faults(checks: list[tuple[str, str, str]]) -> list[str]:
    return [what for what, found, _ in checks if found.startswith(("missing", "FAILED"))]


def _tried(check: Callable[[], tuple[str, str, str]], what: str) -> tuple[str, str, str]:
    """A check's row, or what went wrong: a doctor does not fall ill."""
    try:
        return check()
    except Exception as error:
        return what, f"FAILED: {error!r}", ""


def _python() -> tuple[str, str, str]:
    return "python", platform.python_version(), "everything"


def _cores() -> tuple[str, str, str]:
    from s2c2a.executors import all_cores

    return "cores", str(all_cores()), "trainings, runs and collecting go side by side"


def _packages() -> list[tuple[str, str, str]]:
    from importlib.metadata import PackageNotFoundError, version

    rows = []
    for name, use in (NEEDED | EXTRAS).items():
        try:
            rows.append((name, version(name), use))
        except PackageNotFoundError:
            rows.append((name, "missing" if name in NEEDED else "not installed", use))
    return rows


def _simulation() -> tuple[str, str, str]:
    from s2c2a.arm import load_arm
    from s2c2a.robots import check_robot
    from s2c2a.robots.simulation import SimulatedRobot

    check_robot(SimulatedRobot(load_arm("twin_arm")))
    return "simulated arm", "opens, moves, keeps its promises", "collect, run, demo"


def _numerics() -> tuple[str, str, str]:
    import jax

    return "JAX device", ", ".join(sorted({device.platform for device in jax.devices()})), "cpu is enough"


def _cache() -> tuple[str, str, str]:
    from s2c2a.cache import cache_folder

    folder = cache_folder()
    existing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    writable = os.access(existing, os.W_OK)
    free = shutil.disk_usage(existing).free / 1e9
    found = f"{folder} ({free:.0f} GB free)" if writable else f"FAILED: {folder} cannot be written"
    return "cache folder", found, "run"


def _programs() -> list[tuple[str, str, str]]:
    browser = next((path for name in ("chromium", "google-chrome", "firefox") if (path := shutil.which(name))), None)
    return [("browser", browser or "none found here; replay pages open in any", "replay pages")]
