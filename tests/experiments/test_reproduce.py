"""`s2c2a reproduce NAME` has the settings with which the kept rows were made."""

import json
from contextlib import contextmanager

import pytest

from s2c2a_experiments import beyond_the_paper, cli

from tools import ROOT


class RequestedError(Exception):
    """Artifacts were asked for."""


@pytest.fixture
def asked(monkeypatch, tmp_path):
    """Options of a table, and what it asks for instead of making it."""
    seen = {}

    def make(artifacts):
        raise RequestedError(len(artifacts))

    @contextmanager
    def directory(label, options, *_, **__):
        seen.update(json.loads(json.dumps(options, default=str)))
        yield tmp_path, make

    for module in (beyond_the_paper, cli):
        monkeypatch.setattr(module, "run_directory", directory)
    return seen


@pytest.mark.parametrize(
    "name",
    [
        "motion",
        "repetition",
        "scenes",
        "sensor-faults",
        "session",
        "shapes",
        "stability",
    ],
)
def test_a_table_has_the_settings_of_its_rows(name, asked, monkeypatch):
    for rows in ("session.session_rows", "shapes.shape_rows", "scenes.scene_rows"):
        monkeypatch.setattr(f"s2c2a_experiments.{rows}", failing)
    with pytest.raises(RequestedError):
        cli.reproduce(name)
    file = ROOT / "results" / name / "options.json"
    options = json.loads(file.read_text(encoding="utf-8"))["options"]
    assert asked == options


def failing(*_):
    raise RequestedError


@pytest.mark.parametrize("name", ["all", "paths", *beyond_the_paper.RANDOMIZED])
def test_a_table_asks_for_its_runs(name, asked):
    with pytest.raises(RequestedError):
        cli.reproduce(name)
    assert asked


def test_randomized_arms_have_the_settings_of_their_rows(asked):
    with pytest.raises(RequestedError):
        cli.reproduce("randomised-arms-paths-strong")
    assert (asked["arms"], asked["strength"]) == (2, 1.0)
    assert (asked["strategies"], asked["targets"]) == (["best"], 0)
    assert asked["tasks"] == list(beyond_the_paper.PATHS)
