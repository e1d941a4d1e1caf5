"""What tests of the examples share."""

import json

import pytest

from s2c2a.cli.main import main


@pytest.fixture
def run_errors(tmp_path):
    """Run a task; return the mean position error [cm] of every strategy."""

    def run(task, *options) -> dict[str, float]:
        main(["run", str(task), "--out", str(tmp_path / "run"), *map(str, options)])
        rows = json.loads((tmp_path / "run" / "results.json").read_text())
        errors = [row for row in rows if row["metric"] == "position"]
        return {row["strategy"]: row["mean"] for row in errors}

    return run


@pytest.fixture
def aside(tmp_path):
    """A short lateral motion."""
    path = tmp_path / "aside.csv"
    path.write_text("time,x,y,z\n0,0,0,0.6\n1,0.05,0,0.59\n")
    return path
