"""Versions of the software that results depend on."""

import os
import platform
import subprocess
from functools import cache
from importlib.metadata import version
from pathlib import Path

import s2c2a

PACKAGES = ("jax", "jaxlib", "equinox", "optax", "mujoco", "numpy")
CHECKOUT = Path(__file__).resolve().parents[3]
"""Of the sources, if the package runs from one."""
GIT_PATIENCE = 10.0  # s


def versions() -> dict[str, str]:
    """Versions of this package, of Python and of `PACKAGES`, by name.

    Between two versions of this package, "commit" tells which sources they are, if they
    are those of a Git checkout.
    """
    numbers = {"s2c2a": s2c2a.__version__, "python": platform.python_version()}
    if commit := _commit():
        numbers["commit"] = commit
    for name in PACKAGES:
        numbers[name] = version(name)
    return numbers


@cache
def _commit() -> str:
    """Commit of the checkout, and whether its sources differ from it; empty without."""
    if not (CHECKOUT / ".git").exists():
        return ""
    ask = ("git", "--no-optional-locks", "-C", CHECKOUT, "status")
    try:
        lines = subprocess.run(
            [*ask, "--porcelain=v2", "--branch", "--", "src", "experiments"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=True,
            encoding="utf-8",
            # those of a Git hook name another checkout
            env={name: text for name, text in os.environ.items() if name[:4] != "GIT_"},
            timeout=GIT_PATIENCE,
        ).stdout.splitlines()
    except (OSError, subprocess.SubprocessError):  # no Git, or a folder of another user
        return ""
    changed = any(not line.startswith("#") for line in lines)
    commit = lines[0].removeprefix("# branch.oid ")
    return f"{commit} with changes" if changed else commit
