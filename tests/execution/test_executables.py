"""Programs on disk: what makes them others, and what happens to strange files."""

import time
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import s2c2a
from compilations import compilations
from s2c2a.execution import executables
from s2c2a.execution.compilation import compiled, forget_programs
from s2c2a.kinematics import states_from_bends
from s2c2a.planning import horizon

LENGTHS = np.full(3, 0.2, np.float32)
BENDS = np.full((3, 2), 0.3, np.float32)


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


def test_all_sources_and_what_programs_are_made_of_are_known_by_name():
    assert Path(s2c2a.__file__).parent == executables.PACKAGE
    names = executables.TRACED.pattern.partition("(")[2].partition(")")[0]
    for name in names.replace("\\", "").split("|"):
        assert find_spec(f"s2c2a.{name}") is not None
    for function in (compiled, states_from_bends):
        assert executables.TRACED.match(function.__module__)


def lengthened(lengths, bends):
    """Custom code."""
    return states_from_bends(bends, 2.0 * lengths)


def made_after_a_start() -> int:
    """Number of programs that a process compiles which starts now."""
    forget_programs(max_maps=0)
    before = compilations()
    states = compiled(states_from_bends, BENDS)(LENGTHS)
    count = compilations() - before
    np.testing.assert_allclose(states, states_from_bends(BENDS, LENGTHS), atol=1e-6)
    return count


def test_a_later_start_compiles_nothing(folder):
    assert made_after_a_start() == 1
    (file,) = folder.iterdir()
    assert file.stat().st_mode & 0o777 == 0o600
    assert made_after_a_start() == 0


def moved_away(file):
    file.symlink_to(file.rename(file.parents[1] / "elsewhere"))


STRANGE = {
    "half": lambda file: file.write_bytes(
        file.read_bytes()[: file.stat().st_size // 2]
    ),
    "another byte": lambda file: file.write_bytes(file.read_bytes()[:-1] + b"!"),
    "others can write it": lambda file: file.chmod(0o666),
    "a link": moved_away,
}


@pytest.mark.parametrize("change", STRANGE.values(), ids=STRANGE)
def test_a_damaged_or_strange_file_is_replaced(folder, change):
    made_after_a_start()
    (file,) = folder.iterdir()
    change(file)
    assert made_after_a_start() == 1
    assert made_after_a_start() == 0


def test_custom_code_is_not_kept(folder):
    for function in (lengthened, lambda lengths, bends: bends):
        compiled(function, LENGTHS)(BENDS)
    assert not folder.exists()


def test_lambdas_of_one_name_are_two_programs(folder):
    first, second = compiled(lambda x: x + 1.0), compiled(lambda x: 2.0 * x)
    assert float(first(np.float32(5.0))) == 6.0
    assert float(second(np.float32(5.0))) == 10.0


def test_nothing_is_kept_once_sources_have_changed(folder, monkeypatch):
    monkeypatch.setattr(executables, "IMPORTED", time.time() - 1e9)
    assert made_after_a_start() == 1
    assert not folder.exists()


def test_a_changed_constant_or_function_makes_another_program(folder, monkeypatch):
    places = {executables.place_of("program")}
    with monkeypatch.context() as changed:
        changed.setattr(horizon, "DAMPING", 2.0 * horizon.DAMPING)
        places.add(executables.place_of("program"))
    with monkeypatch.context() as changed:
        changed.setattr(horizon.Horizon, "coupling", horizon.Horizon.next)
        places.add(executables.place_of("program"))
    with monkeypatch.context() as changed:
        changed.setattr(horizon.Horizon, "coupling", lambda self, size: None)
        assert executables.place_of("program") is None  # whatever the lambda does
    assert len(places) == 3
    assert executables.place_of("program") in places


def test_a_folder_that_cannot_be_made_is_no_error(folder):
    folder.write_text("a file")
    assert made_after_a_start() == 1


def test_a_cache_of_the_user_stays_the_only_one(folder, monkeypatch):
    monkeypatch.setattr(executables.CONFIG, "jax_compilation_cache_dir", "mine")
    assert executables.place_of("program") is None
