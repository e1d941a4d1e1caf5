"""Flags of XLA that the installed version knows; it ends a process that names others."""

import os
import subprocess
import sys
from collections.abc import Sequence

FIRST_ARRAY = "import jax; jax.numpy.zeros(1)"  # flags are read then


def known_flags(flags: Sequence[str]) -> list[str]:
    """Those of the flags with which a process can start."""
    if _starts_with(flags):
        return list(flags)
    return [flag for flag in flags if _starts_with([flag])]


def _starts_with(flags: Sequence[str]) -> bool:
    environment = {**os.environ, "XLA_FLAGS": " ".join(flags), "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", FIRST_ARRAY]
    return not subprocess.run(command, env=environment, capture_output=True).returncode
