"""Cables of simulated arms are identified from logs with shuffled, reversed columns."""

import re
from dataclasses import replace

import numpy as np
import pytest
from cable_parameters import straight_arm, wiring_of
from simulated_logs import record, write_log  # type: ignore[import-not-found]

from s2c2a.arm import ArmGeometry, ArmSpec, load_arm
from s2c2a.arm.randomized import randomized_arm
from s2c2a.data import load_recording
from s2c2a.episodes import load_episodes
from s2c2a.logs import (
    Imported,
    import_logs,
    import_take,
    map_from_toml,
    model_fit,
    save_imported,
    summary,
)
from s2c2a.logs.cable_search import FITTING, PARTS
from s2c2a.logs.pipeline import COMPARING, READING
from s2c2a.logs.rotation_changes import describe_rotations, other_readings
from s2c2a.logs.take import LogTake


def with_angles(arm: ArmSpec, name: str, angles) -> ArmSpec:
    modules = [
        module.model_copy(update={"cable_angles_deg": module_angles})
        for module, module_angles in zip(arm.modules, angles, strict=False)
    ]
    return arm.model_copy(update={"name": name, "modules": tuple(modules)})


def within_range(imported: Imported) -> None:
    """All rows of a log are within the range of its arm file."""
    geometry = ArmGeometry.of(imported.arm)
    for episode in imported.episodes:
        for name in ("actions", "sensor.cables"):
            assert (episode[name] <= geometry.action_high + 1e-9).all()
            assert (episode[name] >= geometry.action_low - 1e-9).all()
    assert not any("beyond the range" in line for line in summary.summary(imported))


TWIN = load_arm("twin_arm")
OTHER = with_angles(TWIN, "other", [(20.0, 140.0, 260.0), (75.0, 200.0, 310.0)])


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Motor babbling of both arms."""
    folder = tmp_path_factory.mktemp("recordings")
    return {
        arm.name: record(folder / f"{arm.name}.episodes", arm, 200)
        for arm in (TWIN, OTHER)
    }


DRIVES = [f"d{drive}" for drive in range(6)]
QUATERNION = 'quaternion = ["q0", "q1", "q2", "q3"]\norder = "xyzw"\n'
ANGLES_DEG = [(0.0, 120.0, 240.0), (60.0, 180.0, 300.0)]
MODEL = straight_arm([0.12, 0.12], ANGLES_DEG, gain=np.log(0.05))


def two_modules(tip="", drive=""):
    """Map of six drives [mm] and both ends."""
    text = '[rows]\nkind = "steps"\n'
    text += '[arm]\nname = "two"\nmodules = 2\ncontrol_rate = 5\n'
    for name in DRIVES:
        text += f'[[drives]]\ncommanded = "{name}"\nunit = "mm"\n{drive}'
    text += '[[ends]]\nmodule = 0\nposition = ["a", "b", "c"]\nunit = "m"\n'
    text += f'[[ends]]\nposition = ["x", "y", "z"]\nunit = "m"\n{tip}'
    return map_from_toml(text)


def simulate(sign):
    """Wiring, drives [mm] and states of cables that are slack half of the time."""
    columns = np.random.default_rng(5).uniform(-15.0, 15.0, (600, 6))
    wiring = wiring_of(2, sign)
    states = model_fit.predict_states(MODEL, wiring, columns, tension=False)[1]
    return wiring, columns, states


def write_states(path, columns, states):
    ends = states[..., :3].reshape(600, 6)
    ends += np.random.default_rng(6).normal(0.0, 1e-3, ends.shape)
    header = ",".join([*DRIVES, *"abcxyz"])
    table = np.hstack([columns, ends])
    np.savetxt(path, table, "%.5f", ",", header=header, comments="")
    return path


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_signs_that_all_drives_share_are_found(tmp_path, sign):
    _, columns, states = simulate(sign)
    path = write_states(tmp_path / "log.csv", columns, states)
    shown = []
    imported = import_logs([path], two_modules(), progress=lambda *s: shown.append(s))
    works = dict.fromkeys(work for work, _, _ in shown)
    assert list(works) == [READING, FITTING, COMPARING]
    parts = [done for work, done, _ in shown if work == FITTING]
    assert parts == sorted(set(parts))
    assert parts[-1] == PARTS
    assert imported.assignment.signs.tolist() == [sign] * 6
    assert imported.residual < 3e-3
    assert not ambiguous_modules(imported)


def test_rotations_of_one_end_are_judged_without_those_of_the_other():
    log_map = two_modules(QUATERNION)
    wiring, columns, states = simulate(-1.0)
    axes = states[..., 3:].copy()
    axes[:, 0] = np.nan
    zeros = np.zeros((600, 6))
    right = LogTake(zeros[:, 0], columns, columns, states[..., :3], axes, zeros[:, 0])
    wrong = replace(right, axes=-axes)
    others = [
        (clause, [right if clause == 'order = "wxyz"' else wrong])
        for clause, _ in other_readings(log_map.ends)
    ]
    fit = model_fit.CableFit(MODEL, wiring, 0.0)
    sentence = describe_rotations([wrong], others, log_map, np.eye(3), fit)
    assert 'write order = "wxyz" for the ends' in sentence


def ambiguous_modules(imported: Imported) -> set[int]:
    """Modules whose signs are ambiguous; texts count from 1."""
    found = re.findall(r"signs of module (\d+)", "\n".join(imported.ambiguities))
    return {int(number) - 1 for number in found}


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_every_sign_that_is_not_identified_is_ambiguous(tmp_path, seed):
    """The tip alone, of arms that the cable model fits badly; all signs are equal."""
    arm = randomized_arm(TWIN, seed, 0.5)
    recording = record(tmp_path / "arm.episodes", arm, 150)
    log = write_log(tmp_path, recording, tip_only=True, shuffled=False)
    modules = log.order // arm.cable_count
    first, *drives = log.map.split("[[drives]]\n")
    stated = [
        f"module = {module}\n{drive}"
        for module, drive in zip(modules, drives, strict=True)
    ]
    imported = import_logs(
        [log.path], map_from_toml("[[drives]]\n".join([first, *stated]))
    )
    is_reversed = imported.assignment.signs == log.signs
    assert set(modules[is_reversed]) <= ambiguous_modules(imported)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "tip_only"), [("other", True), ("twin_arm", False)])
def test_modules_signs_and_angles_are_identified_or_a_sign_is_ambiguous(
    recordings, tmp_path, name, tip_only
):
    log = write_log(tmp_path, recordings[name], tip_only)
    imported = import_logs([log.path], map_from_toml(log.map))
    arm: ArmSpec = log.arm
    modules = log.order // arm.cable_count
    all_angles = np.concatenate([module.cable_angles_deg for module in arm.modules])
    angles = all_angles[log.order]
    np.testing.assert_array_equal(imported.assignment.modules, modules)
    # a positive displacement releases the cable
    is_reversed = imported.assignment.signs == log.signs
    assert set(modules[is_reversed]) <= ambiguous_modules(imported)
    # all cables of a module, or none
    assert all(len(set(is_reversed[modules == module])) == 1 for module in modules)
    identified = np.rad2deg(imported.fit.parameters.angles) + 180 * is_reversed
    errors = (identified - angles + 180) % 360 - 180
    assert np.abs(errors).max() < 15
    within_range(imported)
    # at most 5.2 deg in the recording
    assert 2.0 < imported.arm.step_limit_deg < 12.0
    acceleration = imported.arm.acceleration_limit_deg
    assert acceleration is not None
    assert 0.1 < acceleration <= 2.0 * imported.arm.step_limit_deg
    guess = "gravity_direction = [0.0, 0.0, -1.0]  # a guess"
    assert guess in imported.text
    assert imported.fit.std is not None
    std = np.rad2deg(imported.fit.std.angles)
    assert std.max() < 30
    assert (np.abs(errors) < 4 * std).all()


@pytest.mark.slow
def test_the_scatter_of_stretches_alone_is_smaller(recordings, tmp_path, monkeypatch):
    monkeypatch.setattr(model_fit, "ERROR_PATTERNS", np.inf)
    log = write_log(tmp_path, recordings["other"], tip_only=True)
    scatter = import_logs([log.path], map_from_toml(log.map)).fit.std
    assert scatter is not None
    assert np.rad2deg(scatter.angles).max() < 15


@pytest.mark.slow
def test_a_recording_returns_in_the_base_frame_of_a_stated_arm(recordings, tmp_path):
    recording = recordings["other"]
    log = write_log(tmp_path, recording, tip_only=False, signs_stated=True)
    imported = import_logs([log.path], map_from_toml(log.map), OTHER)
    path = tmp_path / "back.episodes"
    save_imported(imported, path, {"license": "none"})
    back = load_recording(path)
    assert back.arm == OTHER
    assert len(back.episodes) == 2
    for episode, original in zip(back.episodes, recording.episodes, strict=True):
        np.testing.assert_allclose(episode["actions"], original["actions"], atol=1e-6)
        np.testing.assert_allclose(
            episode.sensor("cables"), original.sensor("cables"), atol=1e-6
        )
        states = episode.sensor("states")
        errors = states[..., :3] - original.sensor("states")[..., :3]
        assert np.sqrt(np.mean(np.sum(errors**2, axis=-1))) < 0.03
        assert np.isnan(states[..., 3:]).all()
    assert load_episodes(path)[1]["license"] == "none"
    # the same log as another take
    take = import_take([log.path], map_from_toml(log.map), back)
    for episode, original in zip(take.episodes, back.episodes, strict=True):
        for name in ("actions", "sensor.cables", "sensor.states"):
            np.testing.assert_allclose(episode[name], original[name], atol=1e-7)
    assert np.nanmax(np.abs(take.change.tips)) < 1e-7
