"""Cables of simulated arms are found again in logs whose columns were shuffled and turned round."""

import numpy as np
import pytest
from simulated_logs import recorded, written  # type: ignore[import-not-found]

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.data import load_recording
from s2c2a.episodes import load_episodes
from s2c2a.logs import fitting, import_again, import_logs, map_from_toml, save_imported

TWIN = load_arm("twin_arm")
OTHER_ANGLES = ((20.0, 140.0, 260.0), (75.0, 200.0, 310.0))
OTHER = TWIN.model_copy(
    update={
        "name": "other",
        "modules": tuple(
            module.model_copy(update={"cable_angles_deg": angles})
            for module, angles in zip(TWIN.modules[:2], OTHER_ANGLES, strict=True)
        ),
    }
)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Motor babbling of both arms."""
    folder = tmp_path_factory.mktemp("recordings")
    return {
        arm.name: recorded(folder / f"{arm.name}.episodes", arm, 200)
        for arm in (TWIN, OTHER)
    }


@pytest.mark.parametrize(("name", "tip_alone"), [("other", True), ("twin_arm", False)])
def test_modules_signs_and_angles_are_found_again_or_a_sign_is_in_doubt(
    recordings, tmp_path, name, tip_alone, monkeypatch
):
    log = written(tmp_path, recordings[name], tip_alone)
    imported = import_logs([log.log], map_from_toml(log.map))
    arm: ArmSpec = log.arm
    owners, angles = (
        log.order // arm.cable_count,
        np.concatenate([m.cable_angles_deg for m in arm.modules])[log.order],
    )
    np.testing.assert_array_equal(imported.motors.modules, owners)
    # in the recording a displacement lets go
    turned = imported.motors.signs == log.signs
    doubted = {int(doubt.split()[1].strip(":")) for doubt in imported.doubts}
    assert set(owners[turned]) <= doubted
    # all cables of a module, or none
    assert all(len(set(turned[owners == module])) == 1 for module in owners)
    off = (
        np.rad2deg(imported.fit.guess.angles) + 180 * turned - angles + 180
    ) % 360 - 180
    assert np.abs(off).max() < 15
    # babbling: 5.2 deg at most where the model is right
    assert 2.0 < imported.arm.step_limit_deg < 12.0
    assert imported.fit.errors is not None
    told = np.rad2deg(imported.fit.errors.angles)
    assert told.max() < 30
    assert (np.abs(off) < 4 * told).all()
    monkeypatch.setattr(fitting, "WAYS", np.inf)  # how much stretches disagree, alone
    scattered = import_logs([log.log], map_from_toml(log.map)).fit.errors
    assert scattered is not None
    assert np.rad2deg(scattered.angles).max() < 15


def test_what_was_recorded_comes_back_in_the_base_frame_of_a_stated_arm(
    recordings, tmp_path
):
    recording = recordings["other"]
    log = written(tmp_path, recording, tip_alone=False, signs_stated=True)
    imported = import_logs([log.log], map_from_toml(log.map), OTHER)
    save_imported(imported, tmp_path / "back.episodes", {"license": "none"})
    back = load_recording(tmp_path / "back.episodes")
    assert back.arm == OTHER
    assert len(back.episodes) == 2
    for episode, original in zip(back.episodes, recording.episodes, strict=True):
        np.testing.assert_allclose(episode["actions"], original["actions"], atol=1e-6)
        np.testing.assert_allclose(
            episode.sensor("cables"), original.sensor("cables"), atol=1e-6
        )
        apart = episode.sensor("states")[..., :3] - original.sensor("states")[..., :3]
        assert np.sqrt(np.mean(np.sum(apart**2, axis=-1))) < 0.03
        assert np.isnan(episode.sensor("states")[..., 3:]).all()
    assert load_episodes(tmp_path / "back.episodes")[1]["license"] == "none"
    # the same log, read as another session would be
    again = import_again([log.log], map_from_toml(log.map), back)
    for episode, one in zip(again.episodes, back.episodes, strict=True):
        for name in ("actions", "sensor.cables", "sensor.states"):
            np.testing.assert_allclose(episode[name], one[name], atol=1e-7)
    assert np.abs(again.nearby.moved).max() < 1e-7
    assert again.nearby.cables.max() < 1e-7
