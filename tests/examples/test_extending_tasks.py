"""A custom task, from a user file, through the command line."""

import json
from pathlib import Path

import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.main import main
from s2c2a.errors import TargetError
from s2c2a.tasks import load_task

OWN = Path(__file__).parents[2] / "examples" / "extending" / "own_task.py"


@pytest.mark.slow
def test_a_custom_task_is_run_and_scored(tmp_path):
    main(f"run {OWN}:figure_of_eight --strategy pcc --out {tmp_path / 'run'}".split())
    rows = json.loads((tmp_path / "run" / "results.json").read_text())
    assert [(row["task"], row["strategy"], row["metric"]) for row in rows] == [
        ("eight", "pcc", "position"),
        ("eight", "pcc", "path length"),
    ]
    assert 0 < rows[0]["mean"] < 10
    assert (tmp_path / "run" / "twin_arm.html").exists()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        ("nothing", "has no attribute 'nothing'"),
        ("fails", "cannot be made for twin_arm: ValueError: half done"),
        ("makes_a_number", "made 3; its function takes an arm and returns a Task"),
    ],
)
def test_an_invalid_custom_task_is_reported(function, message, tmp_path):
    file = tmp_path / f"odd_{function}.py"  # a module is imported once by its name
    failing = "def fails(arm):\n    raise ValueError('half done')\n\n\n"
    file.write_text(failing + "def makes_a_number(arm):\n    return 3\n")
    with pytest.raises(TargetError, match=message):
        load_task(f"{file}:{function}", load_arm("twin_arm"))
