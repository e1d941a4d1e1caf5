"""Cache folder and JAX's persistent compilation cache."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from s2c2a.cache import cache_folder
from s2c2a.jax_settings import configure_jax

LOG_LEVEL = "TF_CPP_MIN_LOG_LEVEL"
NAMES = (
    "JAX_COMPILATION_CACHE_DIR",
    "JAX_COMPILATION_CACHE_MAX_SIZE",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS",
)
COMPILE = """
import s2c2a
import os
os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0"
import jax
import jax.numpy as jnp
function = jax.jit(lambda x: jnp.linalg.svd(jnp.outer(x, x) + 1.0)[1].sum())
print(float(function(jnp.arange(5.0))))
"""

SETTINGS_OF_JAX = """
import json
print(json.dumps([
    jax.config.jax_compilation_cache_dir,
    jax.config.jax_compilation_cache_max_size,
    jax.config.jax_persistent_cache_min_compile_time_secs,
]))
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


@pytest.fixture
def settings_after(bare, tmp_path):
    """Settings of JAX's cache after some statements, in a process of their own."""

    def run(statements: str, **environment: str) -> list:
        done = subprocess.run(
            [sys.executable, "-c", statements + SETTINGS_OF_JAX],
            env={**os.environ, "S2C2A_CACHE": str(tmp_path), **environment},
            capture_output=True,
            text=True,
            check=True,
        )
        assert not done.stderr
        return json.loads(done.stdout)

    return run


@pytest.mark.parametrize(
    "statements", ["import s2c2a\nimport jax", "import jax\nimport s2c2a"]
)
def test_the_import_of_the_package_enables_the_cache(
    settings_after, tmp_path, statements
):
    ours = [str(tmp_path / "programs"), 500_000_000, 0.05]
    assert settings_after(statements) == ours


def test_a_cache_that_environment_variables_configure_stays(settings_after):
    configured = {NAMES[0]: "mine"}
    folder, max_size, _ = settings_after("import s2c2a\nimport jax", **configured)
    assert (folder, max_size) == ("mine", -1)


def test_a_cache_that_was_configured_in_jax_stays(settings_after):
    configure = "import jax\njax.config.update('jax_compilation_cache_dir', 'mine')\n"
    folder, max_size, _ = settings_after(f"{configure}import s2c2a")
    assert (folder, max_size) == ("mine", -1)


@pytest.mark.parametrize("place", ["file/cache", "/proc/cache"])
def test_the_import_works_where_no_folder_can_be_made(settings_after, tmp_path, place):
    (tmp_path / "file").touch()
    folder = str(tmp_path / place)  # an absolute place stays as it is
    statements = "import s2c2a\nimport jax\njax.numpy.zeros(3) + 1"
    assert settings_after(statements, S2C2A_CACHE=folder)[0] is None


def test_the_import_does_not_import_jax():
    statements = "import sys, s2c2a\nassert 'jax' not in sys.modules"
    subprocess.run([sys.executable, "-c", statements], check=True)


@pytest.mark.parametrize("given", [None, "0"])
def test_the_log_of_the_compiler_is_quiet_unless_the_user_sets_its_level(
    monkeypatch, given
):
    monkeypatch.setenv(LOG_LEVEL, given or "")  # restored after the test
    if given is None:
        monkeypatch.delenv(LOG_LEVEL)
    configure_jax()
    assert os.environ[LOG_LEVEL] == (given or "3")


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
