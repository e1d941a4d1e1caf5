"""`s2c2a doctor`: what this machine has and lacks."""

import os
import platform
import shutil
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version

GOOD_FOR = {
    "numpy": "everything",
    "pydantic": "arm files",
    "mujoco": "simulation",
    "jax": "networks, planning",
    "equinox": "networks",
    "optax": "training, planning",
    "safetensors": "strategies",
    "scipy": "simulation, tasks",
    "matplotlib": "figures",
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
    from s2c2a.executors import all_cores

    rows = [
        ("python", platform.python_version(), "everything"),
        ("cores", str(all_cores()), "trainings, runs and collecting go side by side"),
        *(
            (name, _package(name, "(extra" in use), use)
            for name, use in GOOD_FOR.items()
        ),
        ("browser", _browser(), "replay pages"),
    ]
    advice = "install the package again with `pip install .`"
    if not _faults(rows):
        advice = "look at the message above"
        rows.append(("simulated arm", _tried(_simulation), "collect, run, demo"))
        rows.append(("JAX device", _tried(_numerics), "cpu is enough"))
        rows.append(("cache folder", _tried(_cache), "run"))
    print_table("What this machine has", ("what", "found", "good for"), rows)
    if faults := _faults(rows):
        print(f"not well: {', '.join(faults)}; {advice}")
        sys.exit(1)


def _faults(rows: list[tuple[str, str, str]]) -> list[str]:
    return [what for what, found, _ in rows if found.startswith(("missing", "FAILED"))]


def _package(name: str, extra: bool) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed" if extra else "missing"


def _browser() -> str:
    found = map(shutil.which, ("chromium", "google-chrome", "firefox"))
    return next(filter(None, found), "none found here; replay pages open in any")


def _tried(check: Callable[[], str]) -> str:
    """What a check found, or what went wrong: a doctor does not fall ill."""
    try:
        return check()
    except Exception as error:
        return f"FAILED: {error!r}"


def _simulation() -> str:
    from s2c2a.arm import load_arm
    from s2c2a.robots import check_robot
    from s2c2a.robots.simulation import SimulatedRobot

    check_robot(SimulatedRobot(load_arm("twin_arm")))
    return "opens, moves, keeps its promises"


def _numerics() -> str:
    import jax

    return ", ".join(sorted({device.platform for device in jax.devices()}))


def _cache() -> str:
    from s2c2a.cache import cache_folder

    folder = cache_folder()
    existing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    free = shutil.disk_usage(existing).free / 1e9
    return (
        f"{folder} ({free:.0f} GB free)"
        if os.access(existing, os.W_OK)
        else f"FAILED: {folder} cannot be written"
    )
