"""Versions of the software that results depend on."""

import platform
from importlib.metadata import version

import s2c2a

PACKAGES = ("jax", "jaxlib", "equinox", "optax", "mujoco", "numpy")


def versions() -> dict[str, str]:
    """Versions of this package, of Python and of `PACKAGES`, by name."""
    numbers = {"s2c2a": s2c2a.__version__, "python": platform.python_version()}
    for name in PACKAGES:
        numbers[name] = version(name)
    return numbers
