"""Cache folder, its bound, and JAX's persistent compilation cache."""

import os
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from s2c2a.execution import cache
from s2c2a.execution.cache import cache_folder, enable_compilation_cache, trim_daily
from s2c2a.execution.jax_settings import configure_jax

LOG_LEVEL = "TF_CPP_MIN_LOG_LEVEL"
NAMES = (
    "JAX_COMPILATION_CACHE_DIR",
    "JAX_COMPILATION_CACHE_MAX_SIZE",
    "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS",
)
COMPILE = """
import os, shutil
import jax
import jax.numpy as jnp
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
function = jax.jit(lambda x: jnp.linalg.svd(jnp.outer(x, x) + 1.0)[1].sum())
values = jnp.arange(5.0)
"""


class Config(dict):
    """Settings of JAX, by attribute as its own."""

    __getattr__ = dict.__getitem__

    def update(self, name, value):
        self[name] = value


@pytest.fixture(autouse=True)
def folder(monkeypatch, tmp_path):
    """Folder of programs; no settings of a user, and JAX is not loaded."""
    for name in NAMES:
        monkeypatch.setenv(name, "")  # restored after the test
        monkeypatch.delenv(name)
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    monkeypatch.delitem(sys.modules, "jax")
    monkeypatch.setattr(cache, "import_after", lambda *_: None)
    return tmp_path / "programs"


@pytest.fixture
def config(monkeypatch):
    """Settings of a JAX that is loaded."""
    settings = Config(jax_compilation_cache_dir=None)
    monkeypatch.setitem(sys.modules, "jax", SimpleNamespace(config=settings))
    return settings


def environment() -> list:
    return [os.environ.get(name) for name in NAMES]


def test_an_environment_variable_sets_the_folder(monkeypatch, tmp_path):
    assert cache_folder() == tmp_path
    monkeypatch.delenv("S2C2A_CACHE")
    assert cache_folder().name == "s2c2a"


def test_the_cache_is_enabled_before_jax_is_imported(folder):
    enable_compilation_cache()
    assert environment() == [str(folder), "-1", "0.05"]


def test_the_cache_is_enabled_in_a_jax_that_is_loaded(folder, config):
    enable_compilation_cache()
    assert config == {
        "jax_compilation_cache_dir": str(folder),
        "jax_persistent_cache_min_compile_time_secs": 0.05,
    }


@pytest.mark.parametrize("name", NAMES)
def test_a_cache_that_environment_variables_configure_stays(monkeypatch, folder, name):
    monkeypatch.setenv(name, "7")
    enable_compilation_cache()
    assert environment() == ["7" if name == own else None for own in NAMES]
    assert not folder.exists()


def test_a_cache_that_was_configured_in_jax_stays(folder, config):
    config["jax_compilation_cache_dir"] = "mine"
    enable_compilation_cache()
    assert config == {"jax_compilation_cache_dir": "mine"}
    assert not folder.exists()


@pytest.mark.parametrize("place", ["file/cache", "/proc/cache"])
def test_no_cache_is_enabled_where_no_folder_can_be_made(monkeypatch, tmp_path, place):
    (tmp_path / "file").touch()
    # an absolute place stays as it is
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path / place))
    enable_compilation_cache()
    assert environment() == [None] * 3


def test_the_log_of_the_compiler_is_quiet_unless_the_user_sets_its_level(monkeypatch):
    monkeypatch.setenv(LOG_LEVEL, "0")
    configure_jax()
    assert os.environ[LOG_LEVEL] == "0"
    monkeypatch.delenv(LOG_LEVEL)
    configure_jax()
    assert os.environ[LOG_LEVEL] == "3"


def test_programs_written_in_part_are_replaced_and_no_warning_is_printed(folder):
    def start(*lines: str) -> subprocess.Popen:
        code = "\n".join([*lines, "function(values)"])
        return subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE)

    def finish(process: subprocess.Popen) -> None:
        errors = process.communicate()[1]
        assert (process.returncode, errors) == (0, b"")

    finish(start("import s2c2a, sys", "assert 'jax' not in sys.modules", COMPILE))
    (program,) = folder.glob("jit__lambda*-cache")
    size = program.stat().st_size
    os.truncate(program, size // 2)
    enable_compilation_cache()  # a process inherits the settings of this one
    two = [start("import s2c2a", COMPILE) for _ in range(2)]
    for process in two:
        finish(process)
    assert program.stat().st_size > 0.9 * size
    lose_folder = (f"shutil.rmtree({str(folder)!r})", f"open({str(folder)!r}, 'w')")
    finish(start("import jax, s2c2a", COMPILE, *lose_folder))
    assert folder.is_file()


@pytest.fixture
def folders(tmp_path):
    """Two folders with files of ten bytes; the higher their number, the older."""
    for age in range(6):
        path = tmp_path / ("programs", "executables")[age % 2] / f"{age}-cache"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(bytes(10))
        os.utime(path, (time.time() - 100.0 * age,) * 2)
    return [tmp_path / "programs", tmp_path / "executables"]


def kept(folders) -> list[str]:
    return sorted(path.name for folder in folders for path in folder.glob("*-*e"))


def test_files_that_were_used_longest_ago_go_first(folders):
    oldest = folders[1] / "5-cache"
    os.utime(oldest, (time.time(), oldest.stat().st_mtime))  # read since
    trim_daily(*folders, max_bytes=35)
    assert kept(folders) == ["0-cache", "1-cache", "5-cache"]


def test_files_are_trimmed_once_a_day(folders):
    trim_daily(*folders, max_bytes=25)
    (folders[0] / "new-cache").write_bytes(bytes(30))
    trim_daily(*folders, max_bytes=25)
    assert kept(folders) == ["0-cache", "1-cache", "new-cache"]
    (today,) = folders[0].glob(".trimmed*")
    today.rename(today.with_name(".trimmed-2001-01-01"))
    trim_daily(*folders, max_bytes=35)
    assert kept(folders) == ["new-cache"]
    assert [path.name for path in folders[0].glob(".trimmed*")] == [today.name]


def test_what_killed_processes_and_the_bound_of_jax_left_goes(folders):
    for name in ("0-atime", ".lockfile", ".9-cache.17.part"):
        (folders[0] / name).touch()
    trim_daily(*folders)
    assert kept(folders) == [f"{age}-cache" for age in range(6)]
    assert len(list(folders[0].glob(".*"))) == 1


def test_a_file_that_another_process_deletes_is_no_error(folders, monkeypatch):
    monkeypatch.setattr("pathlib.Path.unlink", lambda path: path.rename(path / "none"))
    trim_daily(*folders, max_bytes=0)
    trim_daily(folders[0] / "missing", max_bytes=0)
