"""What is kept between runs goes where the user says, and is found again."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from s2c2a.cache import cache_folder, keep_programs

NAMES = (
    "JAX_COMPILATION_CACHE_DIR",
    "JAX_COMPILATION_CACHE_MAX_SIZE",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS",
)
COMPILE = """
from s2c2a.cache import keep_programs
keep_programs()
import os
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"  # however quick this machine is
import jax
print(float(jax.jit(lambda x: jax.numpy.linalg.svd(jax.numpy.outer(x, x) + 1.0)[1].sum())(jax.numpy.arange(5.0))))
"""


@pytest.fixture
def bare(monkeypatch):
    for name in (*NAMES, "S2C2A_CACHE"):
        monkeypatch.setenv(name, "")  # so that whatever a test leaves is taken back
        monkeypatch.delenv(name)


def test_the_folder_is_where_the_user_says(bare, monkeypatch, tmp_path):
    assert cache_folder().name == "s2c2a"
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    assert cache_folder() == tmp_path


def test_programs_are_kept_in_the_folder_and_bounded(bare, monkeypatch, tmp_path):
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    keep_programs()
    assert os.environ[NAMES[0]] == str(tmp_path / "programs")
    assert int(os.environ[NAMES[1]]) == 500_000_000


def test_who_has_set_up_a_cache_of_jax_keeps_it(bare, monkeypatch):
    monkeypatch.setenv(NAMES[0], "mine")
    keep_programs()
    assert os.environ[NAMES[0]] == "mine"
    assert NAMES[1] not in os.environ


def test_a_second_process_finds_what_the_first_compiled_and_a_damaged_one_is_made_anew(
    bare, tmp_path
):
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
