"""Example arms, and the folder where data and networks are kept."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.data import CollectOptions
from s2c2a.errors import S2C2AError
from s2c2a.experiments.following import follow, workshop_strategies
from s2c2a.experiments.workshop import Workshop
from s2c2a.strategies import recipe_named

ARMS = Path(__file__).parents[2] / "examples" / "arms"


@pytest.mark.parametrize(("name", "percent"), [("five_cable_arm", 3.0), ("two_module_arm", 5.0)])
def test_an_arm_that_nobody_tuned_for_follows_its_circle(name, percent, tmp_path):
    arm, best = load_arm(ARMS / f"{name}.toml"), recipe_named("best")
    recipe = replace(best, c2s_fit=replace(best.c2s_fit, most_epochs=10), c2a_fit=replace(best.c2a_fit, most_epochs=10))
    runs = follow(["circle"], arm, ("s2c2a",), [0], workshop_strategies(Workshop(tmp_path), arm, recipe), recipe)
    (position,) = runs[0].scores
    assert (position.score.metric, position.unit) == ("position", "cm")
    assert position.value <= percent * arm.length


SMALL = CollectOptions(episodes=2, samples=20)


def test_a_workshop_collects_once(tmp_path):
    told = []
    workshop = Workshop(tmp_path, progress=lambda doing, done, total: told.append(done))
    first = workshop.recording(load_arm("twin_arm"), SMALL)
    told.clear()
    (path,) = tmp_path.glob("*.h5")
    written = path.stat().st_mtime_ns
    with h5py.File(path):  # as another process reads it
        second = workshop.recording(load_arm("twin_arm"), SMALL)
    assert (told, path.stat().st_mtime_ns) == ([], written)
    np.testing.assert_array_equal(first.states, second.states)


def test_a_workshop_replaces_a_damaged_recording(tmp_path):
    workshop = Workshop(tmp_path)
    first = workshop.recording(load_arm("twin_arm"), SMALL)
    (path,) = tmp_path.glob("*.h5")
    path.write_bytes(path.read_bytes()[:700])
    np.testing.assert_array_equal(first.states, workshop.recording(load_arm("twin_arm"), SMALL).states)


def test_an_unknown_controller_is_refused_by_name():
    with pytest.raises(S2C2AError, match="pcc-fitted"):
        Workshop().strategy("magic", load_arm("twin_arm"), recipe_named("paper"), 0)
