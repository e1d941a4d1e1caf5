"""Recordings: episodes of one arm as arrays; invalid values are refused."""

from dataclasses import replace

import numpy as np
import pytest

from s2c2a.data import Recording, load_recording
from s2c2a.episodes import Episode, EpisodeWriter, save_episodes
from s2c2a.errors import RecordingError

EPISODES, SAMPLES = 3, 7
OPTIONS = {
    "babbling": "motor",
    "episodes": EPISODES,
    "samples": SAMPLES,
    "seed": 2,
    "robot": "none",
}


def random_episode(arm, seed: int, **changes) -> Episode:
    """Numbers of the right shapes; a change of None leaves a sensor out."""
    random = np.random.default_rng(seed)
    cables = (SAMPLES, arm.module_count, arm.cable_count)
    columns = {
        "time": 0.1 * np.arange(SAMPLES) + seed,
        "actions": random.normal(size=cables),
        "sensor.cables": random.normal(size=cables),
        "sensor.states": random.normal(size=(SAMPLES, arm.module_count, 6)),
        "sensor.flex": random.normal(size=(SAMPLES, 5)),
    }
    columns |= {f"sensor.{name}": values for name, values in changes.items()}
    return Episode(
        arm, {name: values for name, values in columns.items() if values is not None}
    )


@pytest.fixture
def written(twin, tmp_path):
    """Path of a recording with two of three episodes, and those episodes."""
    path = tmp_path / "two.episodes"
    episodes = [random_episode(twin, seed) for seed in (0, 1)]
    writer = EpisodeWriter.create(path, twin, OPTIONS)
    for episode in episodes:
        writer.append(episode)
    writer.close()
    return path, episodes


def test_a_written_recording_is_read_back_bit_for_bit(written, twin):
    path, episodes = written
    loaded = load_recording(path)
    assert loaded.arm == twin
    assert loaded.options == OPTIONS
    assert list(map(type, loaded.options.values())) == [str, int, int, int, str]
    for name, values in {
        "time": loaded.time,
        "actions": loaded.actions,
        "sensor.flex": loaded.sensor("flex"),
    }.items():
        np.testing.assert_array_equal(
            values, np.stack([episode[name] for episode in episodes])
        )


def test_all_readings_are_one_with_episodes_and_samples_first(written):
    readings = load_recording(written[0]).readings()
    shapes = {name: values.shape for name, values in readings.sensors.items()}
    assert shapes == {
        "cables": (2, SAMPLES, 3, 3),
        "states": (2, SAMPLES, 3, 6),
        "flex": (2, SAMPLES, 5),
    }


def test_a_sensor_that_is_not_in_every_episode_is_not_in_the_recording(twin):
    episodes = random_episode(twin, 0), random_episode(twin, 1, flex=None)
    recording = Recording(twin, {}, episodes)
    assert set(recording.sensors) == {"cables", "states"}
    with pytest.raises(RecordingError, match=r"lacks 'flex'; it has cables, states"):
        recording.sensor("flex")


def test_shorter_episodes_are_padded_with_their_last_row(twin):
    short = Episode(
        twin, {"time": np.arange(3.0), "actions": np.arange(27.0).reshape(3, 3, 3)}
    )
    recording = Recording(twin, {}, (random_episode(twin, 0), short))
    longest = len(recording.episodes[0])
    assert recording.lengths == (longest, 3)
    np.testing.assert_array_equal(recording.actions[1, :3], short["actions"])
    np.testing.assert_array_equal(
        recording.actions[1, 3:],
        np.broadcast_to(short["actions"][2], (longest - 3, 3, 3)),
    )


def test_a_recording_without_a_complete_episode_is_refused(twin, tmp_path):
    EpisodeWriter.create(tmp_path / "empty.episodes", twin, OPTIONS).close()
    with pytest.raises(RecordingError, match="no whole episode"):
        load_recording(tmp_path / "empty.episodes")


@pytest.mark.parametrize("name", ["cables", "states", "flex"])
@pytest.mark.parametrize("value", [2e6, -1e300, np.inf])
def test_values_out_of_range_are_refused(twin, tmp_path, name, value):
    good = random_episode(twin, 0)
    spoilt = good.sensor(name).copy()
    spoilt.flat[5] = value
    save_episodes(
        [good, random_episode(twin, 0, **{name: spoilt})], tmp_path / "odd.episodes"
    )
    with pytest.raises(
        RecordingError, match=rf"'sensor.{name}' has values up to .* Record it again"
    ):
        load_recording(tmp_path / "odd.episodes")


def test_missing_measurements_are_valid(twin, tmp_path):
    flex = np.full((SAMPLES, 5), np.nan)
    save_episodes([random_episode(twin, 0, flex=flex)], tmp_path / "one.episodes")
    assert np.isnan(load_recording(tmp_path / "one.episodes").sensor("flex")).all()


def test_an_incomplete_recording_is_reported(written, twin):
    path, _ = written
    with pytest.raises(RecordingError, match="2 of 3 episodes"):
        load_recording(path).check_complete()
    writer = EpisodeWriter(path)
    writer.append(random_episode(twin, 2))
    writer.close()
    load_recording(path).check_complete()


def test_a_recording_without_a_requested_length_is_complete(written):
    replace(load_recording(written[0]), options={}).check_complete()
