"""Versions of the software that results depend on."""

import platform
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path

import s2c2a

PACKAGES = ("jax", "jaxlib", "equinox", "optax", "mujoco", "numpy")
PACKAGE = Path(__file__).resolve().parents[1]
EXPERIMENTS = PACKAGE.parents[1] / "experiments"
"""Beside the package, in a clone."""


def versions() -> dict[str, str]:
    """Versions of this package, of Python and of `PACKAGES`, by name.

    Between two versions of this package, "sources" tells which files it runs from: it is
    the digest of its code, its arms and its experiments.
    """
    numbers = {
        "s2c2a": s2c2a.__version__,
        "sources": _sources(),
        "python": platform.python_version(),
    }
    for name in PACKAGES:
        numbers[name] = version(name)
    return numbers


@cache
def _sources() -> str:
    digest = blake2b(digest_size=8)
    for folder in (PACKAGE, EXPERIMENTS):
        files = [*folder.rglob("*.py"), *folder.rglob("*.toml")]
        for file in sorted(files):
            digest.update(file.read_bytes())
    return digest.hexdigest()
