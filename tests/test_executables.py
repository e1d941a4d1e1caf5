"""Programs on disk: what makes them others, and what happens to strange files."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from s2c2a import executables
from s2c2a.compilation import compilations, compiled, forget_programs
from s2c2a.planning import horizon

INPUT = np.arange(3.0, dtype=np.float32)
RESULT = [1.0, 4.0, 7.0]


def solved(matrix, values):
    return jnp.linalg.solve(jnp.eye(3), matrix * values) + 1.0


@pytest.fixture
def folder(monkeypatch, tmp_path):
    """Folder of programs, as a user has it."""
    settings = SimpleNamespace(
        jax_compilation_cache_dir=str(tmp_path / "programs"),
        jax_enable_compilation_cache=True,
        jax_enable_x64=False,
        jax_default_matmul_precision=None,
    )
    monkeypatch.setenv("S2C2A_CACHE", str(tmp_path))
    monkeypatch.setattr(executables, "CONFIG", settings)
    return tmp_path / "executables"


def made_after_a_start() -> int:
    """Number of programs that a process compiles which starts now."""
    forget_programs(max_maps=0)
    before = compilations()
    result = compiled(solved, np.full(3, 3.0, np.float32))(INPUT)
    np.testing.assert_allclose(result, RESULT)
    return compilations() - before


def test_a_later_start_compiles_nothing(folder):
    assert made_after_a_start() == 1
    (file,) = folder.iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    assert made_after_a_start() == 0


def test_a_damaged_file_is_replaced(folder):
    made_after_a_start()
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    assert made_after_a_start() == 1
    assert made_after_a_start() == 0


@pytest.mark.parametrize("part", ["file", "folder"])
def test_what_others_can_write_is_not_opened(folder, part):
    made_after_a_start()
    (file,) = folder.iterdir()
    (file if part == "file" else folder).chmod(0o777)
    assert made_after_a_start() == 1


def test_a_changed_constant_or_function_makes_another_program(folder, monkeypatch):
    places = {executables.place_of("program")}
    with monkeypatch.context() as changed:
        changed.setattr(horizon, "DAMPING", 2.0 * horizon.DAMPING)
        places.add(executables.place_of("program"))
    with monkeypatch.context() as changed:
        changed.setattr(horizon.Horizon, "coupling", lambda self, size: None)
        places.add(executables.place_of("program"))
    assert len(places) == 3
    assert executables.place_of("program") in places


def test_a_folder_that_cannot_be_made_is_no_error(folder):
    folder.write_text("a file")
    assert made_after_a_start() == 1


def test_a_cache_of_the_user_stays_the_only_one(folder, monkeypatch):
    monkeypatch.setattr(executables.CONFIG, "jax_compilation_cache_dir", "mine")
    assert executables.place_of("program") is None
