"""Every example runs in an empty folder."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
QUICK = {"01_your_own_arm.py": "module 2 ends at", "04_own_task.py": "out of reach"}
SLOW = {
    "03_a_target_that_moves.py": "its target was at",
    "05_plan_many.py": "one target from 16 starts: 0.",
    "02_follow_a_circle.py": "cm from the circle",
    "06_many_machines.py": "dummy workers",
}
"""Examples that train or compile networks of full size, or plans of many arms at once."""


@pytest.mark.parametrize(("name", "output"), QUICK.items())
def test_an_example_runs_and_prints_its_result(
    name, output, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name, "1"])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    assert output in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(("name", "output"), SLOW.items())
def test_a_long_example_runs_and_prints_its_result(name, output, tmp_path):
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, "1"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert output in done.stdout


def test_every_example_is_run():
    assert {path.name for path in EXAMPLES.glob("*.py")} == {*QUICK, *SLOW}


def test_no_example_exceeds_eighty_lines():
    for path in EXAMPLES.glob("*.py"):
        assert len(path.read_text().splitlines()) <= 80, path.name
