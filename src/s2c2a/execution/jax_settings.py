"""Settings that JAX and its compiler XLA read once; `import s2c2a` makes them.

This module does not import JAX.
"""

import os

from s2c2a.execution.cache import enable_compilation_cache

FATAL_ERRORS_ONLY = "3"
"""Level of XLA's log on the standard error. JAX raises what XLA cannot do, so that the
log of errors adds one message only: advice to report a compilation of two minutes,
which a busy computer takes."""


def configure_jax() -> None:
    """Cache compiled programs, and keep XLA's log quiet; the user's settings stay."""
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", FATAL_ERRORS_ONLY)
    enable_compilation_cache()
