"""Import of the example logs of real arms with their map files."""

from pathlib import Path

import numpy as np
import pytest

from s2c2a.arm import ArmGeometry, load_arm
from s2c2a.cli.main import main
from s2c2a.data import load_recording
from s2c2a.live.viewing import drawable
from s2c2a.logs import load_map

DATA = Path(__file__).parents[2] / "examples" / "data"
MAPS = sorted(DATA.glob("*/*.toml"))
SERVOS = {"4": 0, "3": 0, "9": 0, "5": 1, "2": 1, "8": 1, "6": 2, "1": 2, "7": 2}


@pytest.fixture
def short_map(tmp_path):
    """The map of opencr_v4 for its first rows, with known modules, which is faster."""
    text = (DATA / "opencr_v4" / "map.toml").read_text()
    text = text.replace("[rows]", "[rows]\nrows = 300", 1)
    text = text.replace("modules = 3", "modules = 3\ncoupled_cables = true")
    for servo, module in SERVOS.items():
        name = f'"servo_{servo}_mm"'
        text = text.replace(name, f"{name}\nmodule = {module}")
    path = tmp_path / "short.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("path", MAPS, ids=lambda path: path.stem)
def test_every_map_is_valid_and_names_source_and_license(path):
    source = load_map(path).source
    assert all([source.name, source.address, source.commit, source.license])
    assert (DATA / path.parent.name / "LICENSE").is_file()


@pytest.mark.slow
def test_an_opencr_log_becomes_a_recording_and_an_arm(
    short_map, tmp_path, refusal, capsys
):
    out = tmp_path / "opencr.episodes"
    logs = DATA / "opencr_v4"
    command = f"import {logs / 'train.csv.gz'} --map {short_map} --out {out}".split()
    main(command)
    output = capsys.readouterr().out
    assert "1 episode of 300 steps" in output
    assert "end of module 3 in 100.0 % of steps, its axis in 0.0 %" in output
    recording = load_recording(out)
    assert recording.arm == load_arm(tmp_path / "opencr.arm.toml")
    assert recording.options["license"] == "MIT"
    assert recording.options["residual_mm"] < 8
    actions = recording.episodes[0]["actions"]
    geometry = ArmGeometry.of(recording.arm)
    assert (actions >= geometry.action_low).all()
    assert (actions <= geometry.action_high).all()
    # arcs at the bend limit, without what the cables have in common, hold less
    assert np.abs(actions).max() > (geometry.cable_radii * geometry.bend_limits).max()
    states = recording.episodes[0].sensor("states")
    assert np.isfinite(states[:, 2, :3]).all()
    assert np.isnan(states[:, :2]).all()
    assert np.isfinite(drawable(states, recording.arm)).all()
    assert "--overwrite" in refusal(*command)
    other = tmp_path / "val.episodes"
    repeated = ["import", str(logs / "val.csv.gz"), *command[2:4]]
    repeated += ["--like", str(out), "--overwrite"]
    for _ in range(2):
        main([*repeated, "--out", str(other)])
        assert "mm from where it was then" in capsys.readouterr().out
    assert "choose another name" in refusal(*repeated, "--out", str(out))
    assert load_recording(other).arm == recording.arm
    assert not (tmp_path / "val.arm.toml").exists()
