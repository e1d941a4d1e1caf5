"""Datasets of Minari read back equal."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.errors import S2C2AError
from s2c2a.integrations.exports.minari import write_minari

minari = pytest.importorskip("minari")
RECORDING = Path(__file__).parents[2] / "fixtures" / "twin.episodes"


def test_a_dataset_has_one_observation_more_than_actions(tmp_path, monkeypatch):
    episodes = load_episodes(RECORDING)[0][:2]
    path = tmp_path / "my arm.episodes"
    save_episodes(episodes, path, {})
    before = os.environ.get("MINARI_DATASETS_PATH")
    monkeypatch.chdir(tmp_path)
    assert write_minari(path, Path("sets")) == "2 episodes of 'my-arm-v0'"
    assert os.environ.get("MINARI_DATASETS_PATH") == before
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    dataset = minari.load_dataset("my-arm-v0")
    assert dataset.total_episodes == 2
    for found, true in zip(dataset.iterate_episodes(), episodes, strict=True):
        states = true.sensor("states").astype(np.float32)
        np.testing.assert_array_equal(found.observations["sensor.states"], states)
        actions = true["actions"][:-1].astype(np.float32)
        np.testing.assert_array_equal(found.actions, actions)
        np.testing.assert_array_equal(found.infos["time"], true["time"])
        assert found.truncations.tolist() == [*[False] * (len(true) - 2), True]
    assert dataset.action_space.contains(found.actions[0])
    first = {name: each[0] for name, each in found.observations.items()}
    assert dataset.observation_space.contains(first)
    description = dataset.storage.metadata["description"]
    assert "actions [m]" in description
    assert "sensor.states [m; axes 1]" in description


def test_targets_are_held_where_there_is_none(tmp_path, monkeypatch):
    (episode, *_), options = load_episodes(RECORDING)
    targets = np.full((len(episode), 3, 3), np.nan)
    targets[5:9, -1] = 0.2
    columns = {**episode.columns, "desired_positions": targets}
    path = tmp_path / "held.episodes"
    save_episodes([replace(episode, columns=columns)], path, options)
    write_minari(path, tmp_path / "sets")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "sets"))
    (found,) = minari.load_dataset("held-v0").iterate_episodes()
    read = found.observations["desired_positions"]
    assert np.isnan(read[:, 0]).all()
    np.testing.assert_array_equal(read[:, -1], np.float32(0.2))


def test_an_episode_of_one_step_is_refused(tmp_path):
    (episode, *_), options = load_episodes(RECORDING)
    columns = {name: values[:1] for name, values in episode.columns.items()}
    path = tmp_path / "short.episodes"
    save_episodes([replace(episode, columns=columns)], path, options)
    with pytest.raises(S2C2AError, match="an episode of one step"):
        write_minari(path, tmp_path / "sets")
