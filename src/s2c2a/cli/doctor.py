"""Command `s2c2a doctor`: check the installation."""

import os
import platform
import shutil
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version

PACKAGE_USES = {
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
    "pyserial": "servo buses (extra hardware)",
    "opencv-contrib-python-headless": "webcams with tags (extra camera)",
    "vqf": "inertial sensors (extra sensors)",
    "distributed": "clusters (extra cluster)",
    "pytest-benchmark": "benchmarks (extra bench)",
    "torch": "comparisons of benchmarks (extra bench)",
    "pyelastica": "comparisons of benchmarks (extra bench)",
}
Finding = tuple[str, str, str]


def doctor() -> None:
    """Check the installation, and say how to install what is missing."""
    from s2c2a.cli.console import print_table
    from s2c2a.execution.executors import all_cores

    rows = [
        ("python", platform.python_version(), "everything"),
        ("cores", str(all_cores()), "parallel training, runs and collecting"),
    ]
    for name, use in PACKAGE_USES.items():
        try:
            found = version(name)
        except PackageNotFoundError:
            found = "not installed" if "(extra" in use else "missing"
        rows.append((name, found, use))
    browsers = filter(None, map(shutil.which, ("chromium", "google-chrome", "firefox")))
    found = next(browsers, "none found here; replay pages open in any")
    rows.append(("browser", found, "replay pages"))
    advice = "install the package again with `pip install .`"
    if not _failed(rows):
        advice = "see the messages above"
        rows.append(("simulated arm", _try(_check_simulation), "collect, run, demo"))
        rows.append(("JAX device", _try(_jax_devices), "cpu is enough"))
        rows.append(("cache folder", _try(_check_cache), "run"))
    print_table("Installation", ("item", "found", "used for"), rows)
    if failed := _failed(rows):
        print(f"problems: {', '.join(failed)}; {advice}")
        sys.exit(1)


def _failed(rows: list[Finding]) -> list[str]:
    return [item for item, found, _ in rows if found.startswith(("missing", "FAILED"))]


def _try(check: Callable[[], str]) -> str:
    """Result of a check, or its error, so that one failure does not end the report."""
    try:
        return check()
    except Exception as error:
        return f"FAILED: {error!r}"


def _check_simulation() -> str:
    from s2c2a.arm import load_arm
    from s2c2a.robots.simulation import SimulatedRobot
    from s2c2a.runtime import check_robot

    check_robot(SimulatedRobot(load_arm("twin_arm")))
    return "fulfills the interface contract"


def _jax_devices() -> str:
    import jax

    return ", ".join(sorted({device.platform for device in jax.devices()}))


def _check_cache() -> str:
    from s2c2a.execution.cache import cache_folder

    folder = cache_folder()
    existing = next(parent for parent in (folder, *folder.parents) if parent.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK | os.X_OK):
        return f"FAILED: {folder} cannot be written; set S2C2A_CACHE to another folder"
    programs = folder / "executables"
    if programs.exists() and programs.stat().st_mode & 0o022:
        return f"FAILED: others can write to {programs}; run `chmod go-w {programs}`"
    free = shutil.disk_usage(existing).free / 1e9
    return f"{folder} ({free:.0f} GB free)"
