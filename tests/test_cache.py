"""Cache folder and JAX's persistent compilation cache."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from s2c2a.cache import cache_folder, enable_compilation_cache

NAMES = (
    "JAX_COMPILATION_CACHE_DIR",
    "JAX_COMPILATION_CACHE_MAX_SIZE",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS",
)
COMPILE = """
from s2c2a.cache import enable_compilation_cache
enable_compilation_cache()
import os
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
import jax
import jax.numpy as jnp
function = jax.jit(lambda x: jnp.linalg.svd(jnp.outer(x, x) + 1.0)[1].sum())
print(float(function(jnp.arange(5.0))))
"""


@pytest.fixture
def bare(monkeypatch):
    for name in (*NAMES, "S2C2A_CACHE"):
        monkeypatch.setenv(name, "")  # restored after the test
        monkeypatch.delenv(name)


def test_an_environment_variable_sets_the_folder(bare, monkeypatch, tmp_path):
    assert cache_folder().name == "s2c2a"
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path


def test_programs_are_kept_in_the_folder_with_a_size_limit(bare, monkeypatch, tmp_path):
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    enable_compilation_cache()
    assert os.environ[NAMES[0]] == str(tmp_path / "programs")
    assert int(os.environ[NAMES[1]]) == 500_000_000


def test_a_configured_cache_of_jax_stays(bare, monkeypatch):
    monkeypatch.setenv(NAMES[0], "mine")
    enable_compilation_cache()
    assert os.environ[NAMES[0]] == "mine"
    assert NAMES[1] not in os.environ


def test_processes_share_programs_and_replace_damaged_ones(bare, tmp_path):
    environment = {**os.environ, "S2C2A_CACHE": str(tmp_path)}

    def run() -> str:
        done = subprocess.run(
            [sys.executable, "-c", COMPILE],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout

    def kept() -> set[Path]:
        """Files of the program itself."""
        return set((tmp_path / "programs").glob("jit__lambda*-cache"))

    first, programs = run(), kept()
    assert programs
    assert run() == first
    assert kept() == programs
    for used in (tmp_path / "programs").glob("*-atime"):
        used.unlink()
    assert run() == first
    assert kept() == programs  # made anew, and kept again
    for program in programs:
        program.write_bytes(b"no program")
    assert run() == first
