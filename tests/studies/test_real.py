"""Forward models on recordings: what is held out is never shown, and every model answers."""

from pathlib import Path

import numpy as np
import pytest

from s2c2a.data import Recording
from s2c2a.episodes import Episode, save_episodes
from s2c2a.errors import RecordingError
from s2c2a.progress import quiet
from s2c2a.studies.real import Asked, blocks_of, held_rows, last_of, real_rows


@pytest.fixture(scope="module")
def recording(make_arm) -> Recording:
    """A log of one long episode with the tip alone, on which the tip is a bent function of the cables."""
    arm, random = make_arm(1), np.random.default_rng(0)
    path = 0.004 * np.sin(np.cumsum(random.normal(0, 0.15, (600, 2)), axis=0))
    cables = np.stack([path[:, 0], path[:, 1], -path.sum(axis=1)], axis=-1)[:, None]
    states = np.full((600, 1, 6), np.nan)
    states[:, 0, :2], states[:, 0, 2] = 20 * path, 0.2 - 900 * (path**2).sum(axis=1)
    columns = {
        "time": np.arange(600) * 0.5,
        "actions": cables,
        "sensor.cables": cables,
        "sensor.states": states,
    }
    return Recording(
        arm, {"name": "log", "babbling": "imported log"}, (Episode(arm, columns),)
    )


def test_blocks_are_the_seventh_fourteenth_and_twentieth_of_twenty(recording):
    rows = np.flatnonzero(blocks_of(recording, 25).rows[0])
    np.testing.assert_array_equal(
        rows, [*range(150, 175), *range(325, 350), *range(475, 500)]
    )


def test_more_last_rows_than_there_are_is_refused(recording):
    with pytest.raises(RecordingError, match="600"):
        last_of(recording, 600)


@pytest.mark.parametrize("name", ["kernels", "kernels with plays", "pcc-fitted"])
def test_models_answer_with_the_tip_s_error_and_learn_nothing_of_rows_held_out(
    recording, name
):
    held = last_of(recording, 100)
    rows = list(held_rows(recording, held, [name], [0]))
    assert [row.metric for row in rows] == ["tip", "tip, rms", "tip, 95 %"]
    episode = recording.episodes[0]
    lying = episode["sensor.states"].copy()
    lying[-100:, :, :3] += 10.0  # m; whoever learned it would say so
    columns = {**episode.columns, "sensor.states": lying}
    other = Recording(
        recording.arm, recording.options, (Episode(recording.arm, columns),)
    )
    moved = list(held_rows(other, last_of(other, 100), [name], [0]))
    assert 0.0 < rows[0].mean < 60.0
    # [mm] the truth moved away under the same answers
    assert abs(moved[0].mean - 1e4 * np.sqrt(3.0)) < 60.0


@pytest.fixture(scope="module")
def log(recording, tmp_path_factory):
    return save_episodes(
        recording.episodes,
        tmp_path_factory.mktemp("real") / "log.episodes",
        recording.options,
    )


def test_blocks_alone_are_held_out_where_no_last_rows_are_asked_for(log):
    rows = real_rows(Asked.of(log, (), 25, 0, ["pcc-fitted"]), [0], quiet)
    assert [row.task.rpartition(", ")[2] for row in rows] == ["blocks of 25"] * 3


@pytest.mark.parametrize(("block", "last"), [(0, 0), (-5, 0), (600, 0), (25, -1)])
def test_where_nothing_would_be_held_out_nothing_is_tried(log, block, last):
    with pytest.raises(
        RecordingError, match="zero or more" if min(block, last) < 0 else "nothing out"
    ):
        Asked.of(log, (), block, last, ())


def test_another_arm_is_refused_and_recordings_go_by_their_paths(
    recording, log, make_arm, tmp_path, monkeypatch
):
    columns = {
        "time": np.arange(3.0),
        "actions": np.zeros((3, 2, 3)),
        "sensor.states": np.zeros((3, 2, 6)),
    }
    longer = save_episodes(
        [Episode(make_arm(2), columns)],
        tmp_path / "longer.episodes",
        {"babbling": "imported log"},
    )
    with pytest.raises(
        RecordingError, match=r"longer is of test_arm \(2 modules.*imported --like"
    ):
        Asked.of(log, (longer,), 25, 0, ())
    monkeypatch.chdir(tmp_path)
    # alike but for their folders
    names = [Path(day) / "log.episodes" for day in ("monday", "tuesday")]
    for name in names:
        name.parent.mkdir()
        save_episodes(recording.episodes, name, recording.options)
    rows = real_rows(Asked.of(log, names, 0, 0, ["pcc-fitted"]), [0], quiet)
    assert {row.task for row in rows} == {
        "test_arm, monday/log",
        "test_arm, tuesday/log",
    }
