"""Command `s2c2a bench`: computation times on this machine."""

import json
import os

import numpy as np
import pytest

from s2c2a import strategies
from s2c2a.arm import save_arm
from s2c2a.cli.main import main
from s2c2a.errors import S2C2AError
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.models.local import LocalC2S
from s2c2a_experiments import bench
from s2c2a_experiments.first_action import default_model_and_strategy

OPERATIONS = [
    "a plan",
    "a tick",
    "a simulated second, fast",
    "a simulated second, accurate",
    "a later start",
]


@pytest.fixture
def few(monkeypatch):
    """Few repetitions, since the times do not matter."""
    for name, count in {"REPEATS": 20, "SIMULATED_SECONDS": 2, "STARTS": 1}.items():
        monkeypatch.setattr(bench, name, count)
    monkeypatch.setattr(bench, "start_times", lambda arm: [2.0])


@pytest.fixture
def stated(few, monkeypatch):
    """Times as if they had been taken."""

    def timings(*operations):
        return lambda arm: [bench.Timing(name, [1e-3, 2e-3]) for name in operations]

    monkeypatch.setattr(bench, "control_times", timings(*OPERATIONS[:2]))
    monkeypatch.setattr(bench, "simulation_times", timings(*OPERATIONS[2:4]))


def saved_of(folder, *words):
    """What the command saves."""
    main(["bench", *words, "--out", str(folder / "here.json")])
    saved = json.loads((folder / "here.json").read_text())
    assert [entry["what"] for entry in saved["seconds"]] == OPERATIONS
    assert all(
        0 < entry["median"] <= entry["percentile_99"] < 60 for entry in saved["seconds"]
    )
    return saved


@pytest.mark.slow
def test_a_preset_is_timed_with_its_networks(few, tmp_path):
    saved_of(tmp_path)


def test_times_of_a_preset_are_compared_with_the_limits(
    stated, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(os, "getloadavg", lambda: (3.0, 2.0, 1.0))
    saved = saved_of(tmp_path)
    output = capsys.readouterr().out
    assert "busy (load 3.0)" in output
    assert "jax" in output
    assert "1.30 ms" in output
    assert saved["seconds"][0]["at_most"] == 1.3e-3
    assert saved["machine"]["load"] == 3.0


def test_another_arm_is_timed_without_limits(
    stated, make_arm, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr(os, "getloadavg", lambda: (0.0, 0.0, 0.0))
    save_arm(make_arm(), tmp_path / "mine.toml")
    saved = saved_of(tmp_path, "--arm", str(tmp_path / "mine.toml"))
    assert "busy" not in capsys.readouterr().out
    assert [entry["at_most"] for entry in saved["seconds"]] == [None] * len(OPERATIONS)


def test_presets_use_the_networks_of_the_package_and_other_arms_use_pcc(
    twin, make_arm, monkeypatch
):
    for build in ("s2c2a_strategy", "pcc_strategy"):
        monkeypatch.setattr(strategies, build, lambda *_: None)  # takes long
    assert isinstance(default_model_and_strategy(twin)[0], LocalC2S)
    assert isinstance(
        default_model_and_strategy(make_arm(modules=1))[0], PCCForwardModel
    )


def test_a_start_that_fails_is_reported():
    with pytest.raises(S2C2AError, match="no_such_arm"):
        bench.start_times("no_such_arm", starts=1)


def test_calls_are_timed_one_by_one_after_a_warm_up_of_a_tenth():
    calls = []
    times = bench.times_of(lambda: calls.append(len(calls)), 20)
    assert len(calls) == 22
    assert times.shape == (20,)
    assert bench.Timing("", np.arange(101.0)).percentile(99) == 99.0
