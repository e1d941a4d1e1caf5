"""Files that an arm file names are beside it, whatever the current folder is."""

import sys
from pathlib import Path

import pytest

from s2c2a.arm import arm_to_toml, load_arm
from s2c2a.arm.sensors import Raw, Sensors
from s2c2a.arm.tracking import Tracking
from s2c2a.errors import S2C2AError
from s2c2a.execution.sources import code_digest
from s2c2a.lab.tracking import sources
from s2c2a.plugins import discovery
from s2c2a.plugins.discovery import (
    located,
    resolve,
    run_with_trust,
    trust_of_one_command,
    trusted_code,
)

PLACES = {
    "sensor": lambda name: {"sensing": name},
    "sensor_model": lambda name: {
        "sensors": Sensors(raw=(Raw(name="mine", shape=(2,), model=name),))
    },
    "tracker": lambda name: {"tracking": Tracking(source=f"{name},port=9")},
}
"""By kind of code: the keys of an arm file that name it."""


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """The folder of an arm file, and another one, which is the current folder."""
    beside = tmp_path / "lab"
    current = tmp_path / "elsewhere"
    beside.mkdir()
    current.mkdir()
    monkeypatch.chdir(current)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(discovery, "_trusted", {})
    return beside, current


def arm_file(twin, folder: Path, **changes) -> Path:
    file = folder / "mine.toml"
    file.write_text(arm_to_toml(twin.model_copy(update=changes)))
    return file


def code_file(folder: Path, module: str, value: int = 1) -> None:
    (folder / f"{module}.py").write_text(f"class Mine:\n    value = {value}\n")


@pytest.mark.parametrize("kind", PLACES)
def test_code_beside_an_arm_file_is_found_from_another_folder(kind, twin, folders):
    beside, _ = folders
    module = f"beside_{kind}"
    name = f"{module}.py:Mine"
    code_file(beside, module)
    arm = load_arm(arm_file(twin, beside, **PLACES[kind](name)))
    assert resolve(kind, name, {}).value == 1
    # what is stored names the file as it was written
    assert str(beside) not in arm_to_toml(arm)
    assert not arm.differences(twin.model_copy(update=PLACES[kind](name)))


def test_the_file_beside_the_arm_file_comes_before_that_of_the_current_folder(
    twin, folders
):
    for number, folder in enumerate(folders):
        code_file(folder, "found_twice", number)
    load_arm(arm_file(twin, folders[0], sensing="found_twice.py:Mine"))
    assert resolve("sensor", "found_twice.py:Mine", {}).value == 0


def test_a_file_of_the_current_folder_is_found_too(twin, folders):
    beside, current = folders
    code_file(current, "found_here")
    load_arm(arm_file(twin, beside, sensing="found_here.py:Mine"))
    assert resolve("sensor", "found_here.py:Mine", {}).value == 1


def test_an_edit_of_code_beside_an_arm_file_changes_what_depends_on_it(twin, folders):
    beside, _ = folders
    code_file(beside, "edited_beside", 1)
    arm = load_arm(arm_file(twin, beside, sensing="edited_beside.py:Mine"))
    before = code_digest(arm)
    code_file(beside, "edited_beside", 2)
    assert before
    assert code_digest(arm) != before


def test_workers_find_code_beside_an_arm_file(twin, folders, monkeypatch):
    beside, _ = folders
    code_file(beside, "worked_beside")
    load_arm(arm_file(twin, beside, sensing="worked_beside.py:Mine"))
    sent = trusted_code()
    monkeypatch.setattr(discovery, "_trusted", {})  # as in a new process
    name = "worked_beside.py:Mine"
    assert run_with_trust(sent, resolve, "sensor", name, {}).value == 1


def test_the_folder_of_one_command_is_forgotten_by_the_next(twin, folders):
    beside, _ = folders
    code_file(beside, "forgotten_beside")
    name = "forgotten_beside.py:Mine"
    with trust_of_one_command():
        load_arm(arm_file(twin, beside, sensing=name))
    assert located(name, "forgotten_beside.py") == Path("forgotten_beside.py")
    with pytest.raises(S2C2AError, match="a recording or a weight file cannot run"):
        resolve("sensor", name, {})


def test_camera_and_layout_files_are_beside_the_arm_file(twin, folders, monkeypatch):
    beside, _ = folders
    source = "camera:0:camera.json:tags.json"
    for name in ("camera.json", "tags.json"):
        (beside / name).touch()
    made = {}
    monkeypatch.setattr(sources, "_make", lambda cls, options: made.update(options))
    arm = load_arm(arm_file(twin, beside, tracking=Tracking(source=source)))
    sources.tracker_of(arm.tracking.source)
    assert made == {
        "device": "0",
        "camera_file": str(beside / "camera.json"),
        "layout_file": str(beside / "tags.json"),
    }
