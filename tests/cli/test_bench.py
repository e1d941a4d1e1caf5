"""What a user is told of his machine."""

import json
import os

import numpy as np
import pytest

from s2c2a.cli import bench
from s2c2a.cli.first_action import driver_of
from s2c2a.cli.main import main
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import PCCForwardModel
from s2c2a.models.local import LocalC2S

FIGURES = [
    "a plan",
    "a tick",
    "a simulated second, fast",
    "a simulated second, accurate",
    "a later start",
]
GONE = [
    ("bench", "plan", "bench_plan.py"),
    ("bench", "--quick", "make bench"),
    ("bench", "--memory_ticks=7", "make bench"),
    ("bench-live", "--minutes", "bench_live.py"),
]


@pytest.fixture
def few(monkeypatch):
    """A look, not a result."""
    for name, count in {"REPEATS": 20, "SECONDS_SIMULATED": 2, "STARTS": 1}.items():
        monkeypatch.setattr(bench, name, count)
    monkeypatch.setattr(bench, "start_times", lambda arm: [2.0])


def test_a_preset_is_timed_with_its_networks_and_held_to_what_is_asked(
    few, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(os, "getloadavg", lambda: (3.0, 2.0, 1.0))
    main(["bench", "--out", str(tmp_path / "here.json")])
    said = capsys.readouterr().out
    assert "busy (load 3.0)" in said
    assert "jax" in said
    assert "1.30 ms" in said
    kept = json.loads((tmp_path / "here.json").read_text())
    assert [each["what"] for each in kept["seconds"]] == FIGURES
    assert all(
        0 < each["median"] <= each["percentile_99"] < 60 for each in kept["seconds"]
    )
    assert kept["seconds"][0]["at_most"] == 1.3e-3
    assert kept["machine"]["load"] == 3.0


def test_another_arm_is_driven_by_pcc_and_held_to_nothing(
    few, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    main(["arm", "copy", "twin_arm", str(tmp_path / "mine.toml")])
    mine = tmp_path / "mine.toml"
    mine.write_text(
        mine.read_text().replace("bending_stiffness = 0.125", "bending_stiffness = 0.2")
    )
    main(["bench", "--arm", str(mine), "--out", str(tmp_path / "here.json")])
    assert "busy" not in capsys.readouterr().out
    kept = json.loads((tmp_path / "here.json").read_text())
    assert [each["at_most"] for each in kept["seconds"]] == [None] * len(FIGURES)


def test_networks_drive_where_they_come_with_the_package_and_pcc_elsewhere(
    twin, make_arm
):
    assert isinstance(driver_of(twin)[0], LocalC2S)
    assert isinstance(driver_of(make_arm(modules=1))[0], PCCForwardModel)


def test_a_later_start_is_timed_in_a_process_of_its_own():
    (took,) = bench.start_times("twin_arm", starts=1)
    assert 0.3 < took < 120


def test_a_start_that_fails_is_told():
    with pytest.raises(S2C2AError, match="no_such_arm"):
        bench.start_times("no_such_arm", starts=1)


def test_calls_are_timed_one_by_one_after_a_warm_up_of_a_tenth():
    calls = []
    times = bench.times_of(lambda: calls.append(len(calls)), 20)
    assert len(calls) == 22
    assert times.shape == (20,)
    assert bench.Figure("", np.arange(101.0)).percentile(99) == 99.0


@pytest.mark.parametrize(("verb", "word", "instead"), GONE)
def test_what_is_gone_names_what_has_come_in_its_place(verb, word, instead, capsys):
    with pytest.raises(SystemExit) as stopped:
        main([verb, word])
    assert stopped.value.code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"`s2c2a {verb}" in said
    assert instead in said
