"""What results depend on besides their options."""

import platform
from importlib.metadata import version

import s2c2a

PACKAGES = ("jax", "jaxlib", "equinox", "optax", "mujoco", "numpy")


def versions() -> dict[str, str]:
    """Versions of this package and of those that results depend on."""
    found = {name: version(name) for name in PACKAGES}
    return {"s2c2a": s2c2a.__version__, "python": platform.python_version()} | found
