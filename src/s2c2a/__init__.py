"""S2C2A."""

from s2c2a.jax_settings import configure_jax

__version__ = "0.3.0"

configure_jax()  # before a module of the package imports JAX
