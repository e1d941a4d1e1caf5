"""Forward models on recordings: held-out samples are hidden, every model predicts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from s2c2a.data import Recording
from s2c2a.episodes import Episode, save_episodes
from s2c2a.errors import RecordingError
from s2c2a.execution.progress import quiet
from s2c2a_experiments import real_process
from s2c2a_experiments.real import (
    HeldOutSplit,
    RealComparison,
    real_rows,
    split_blocks,
    split_largest,
    split_rows,
)
from s2c2a_experiments.real_models import FittedArcs, KernelRegression, without_curves

from marks import slow_after

METRICS = ["tip", "tip, rms", "tip, 95 %", "log likelihood", "coverage"]


@pytest.fixture(scope="module")
def recording(make_arm) -> Recording:
    """One long episode whose tip is a quadratic function of the cables."""
    arm = make_arm(1)
    random = np.random.default_rng(0)
    path = 0.004 * np.sin(np.cumsum(random.normal(0, 0.15, (600, 2)), axis=0))
    cables = np.stack([path[:, 0], path[:, 1], -path.sum(axis=1)], axis=-1)[:, None]
    states = np.full((600, 1, 6), np.nan)
    states[:, 0, :2] = 20 * path
    states[:, 0, 2] = 0.2 - 900 * (path**2).sum(axis=1)
    columns = {
        "time": np.arange(600) * 0.5,
        "actions": cables,
        "sensor.cables": cables,
        "sensor.states": states,
    }
    return Recording(
        arm, {"name": "log", "babbling": "imported log"}, (Episode(arm, columns),)
    )


def last_rows(recording, count):
    held_out = np.zeros((1, 600), bool)
    held_out[:, -count:] = True
    return HeldOutSplit(f"last {count}", held_out)


def test_blocks_are_the_seventh_fourteenth_and_twentieth_of_twenty(recording):
    rows = np.flatnonzero(split_blocks(recording, 25).held_out[0])
    np.testing.assert_array_equal(
        rows, [*range(150, 175), *range(325, 350), *range(475, 500)]
    )


def test_rows_beside_held_out_ones_are_hidden_from_training(recording):
    split = split_blocks(recording, 25)
    rows = np.flatnonzero(split.hidden(10)[0])
    np.testing.assert_array_equal(
        rows, [*range(140, 185), *range(315, 360), *range(465, 510)]
    )
    np.testing.assert_array_equal(split.hidden(0), split.held_out)


def test_the_largest_pulls_are_held_out_as_stretches(recording):
    split = split_largest(recording, 0.15)
    assert split.name == "largest 15 %"
    held_out = split.held_out[0]
    cables = recording.episodes[0].sensor("cables").reshape(600, -1)
    pulls = np.linalg.norm(cables, axis=1)
    assert 0.05 < held_out.mean() <= 0.15
    assert held_out[np.argmax(pulls)]
    # a stretch ends at 0.9 of the threshold that it reaches
    assert pulls[held_out].min() > 0.85 * np.quantile(pulls, 0.85)
    assert np.abs(np.diff(held_out.astype(int))).sum() < 30


@pytest.mark.parametrize("share", [-0.1, 0.6, float("nan")])
def test_a_share_out_of_range_is_rejected(recording, share):
    with pytest.raises(RecordingError, match=r"above 0 and at most 0\.5"):
        split_largest(recording, share)


def test_equal_pulls_cannot_be_split(recording):
    episode = recording.episodes[0]
    columns = {**episode.columns, "sensor.cables": np.ones((600, 1, 3))}
    constant = replace(recording, episodes=(Episode(recording.arm, columns),))
    with pytest.raises(RecordingError, match="give a longer recording"):
        split_largest(constant, 0.15)


@pytest.mark.parametrize("name", slow_after(1, ["kernels with plays", "pcc-fitted"]))
def test_models_report_tip_errors_and_do_not_see_held_out_samples(recording, name):
    split = last_rows(recording, 100)
    rows = list(split_rows(recording, split, [name], [0]))
    assert [row.metric for row in rows] == [*METRICS, "correlation time"]
    episode = recording.episodes[0]
    shifted = episode["sensor.states"].copy()
    shifted[-100:, :, :3] += 10.0  # m; a model that saw it would predict it
    columns = {**episode.columns, "sensor.states": shifted}
    other = Recording(
        recording.arm, recording.options, (Episode(recording.arm, columns),)
    )
    moved = list(split_rows(other, last_rows(other, 100), [name], [0]))
    assert 0.0 < rows[0].mean < 60.0
    # mm; the true states moved, the predictions did not
    assert abs(moved[0].mean - 1e4 * np.sqrt(3.0)) < 60.0


@pytest.fixture(scope="module")
def log(recording, tmp_path_factory):
    return save_episodes(
        recording.episodes,
        tmp_path_factory.mktemp("real") / "log.episodes",
        recording.options,
    )


def test_another_arm_is_rejected_and_paths_name_recordings(
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
        RealComparison.of(log, (longer,))
    monkeypatch.chdir(tmp_path)
    # the same file name in two directories
    names = [Path(day) / "log.episodes" for day in ("monday", "tuesday")]
    for name in names:
        name.parent.mkdir()
        save_episodes(recording.episodes, name, recording.options)
    comparison = RealComparison.of(log, names)._replace(models=("pcc-fitted",))
    rows = real_rows(comparison, [0], quiet)
    assert {row.task for row in rows} == {
        "test_arm, blocks of 25, gap 25",
        "test_arm, largest 15 %, gap 25",
        "test_arm, monday/log",
        "test_arm, tuesday/log",
    }


def test_rows_of_finished_models_are_kept_when_a_later_one_fails(log, monkeypatch):
    def fail(*_):
        raise ValueError("broken")

    monkeypatch.setattr(KernelRegression, "train", fail)
    kept = []
    comparison = RealComparison.of(log)._replace(
        models=("pcc-fitted", "kernels with plays")
    )
    with pytest.raises(ValueError, match="broken"):
        real_rows(comparison, [0], quiet, lambda rows: kept.append(len(rows)))
    assert kept == [6]


def test_one_command_compares_all_splits_and_judges_a_recording_by_a_whole_training(
    log, monkeypatch
):
    hidden = []

    def train(self, data, *_):
        hidden.append(int(np.isnan(data.states[..., 0]).sum()))
        return without_curves(np.array([1.0, 0.2]))

    monkeypatch.setattr(FittedArcs, "train", train)
    comparison = RealComparison.of(log, [log])
    comparison = comparison._replace(models=("pcc-fitted",), gap=10)
    rows = real_rows(comparison, [0], quiet)
    assert list(dict.fromkeys(row.task for row in rows)) == [
        "test_arm, blocks of 25, gap 10",
        "test_arm, largest 15 %, gap 10",
        "test_arm, log",
    ]
    # 3 blocks with their gaps; nothing is hidden for another session
    assert hidden[0] == 3 * 45
    assert hidden[2] == 0


def test_a_model_that_states_a_deviation_is_also_judged_by_its_rank(
    recording, monkeypatch
):
    monkeypatch.setattr(real_process, "STEPS", 3)
    monkeypatch.setattr(real_process, "ROWS", 100)
    rows = split_rows(recording, last_rows(recording, 100), ["process"], [0])
    assert [row.metric for row in rows] == [
        *METRICS,
        "rank correlation",
        "correlation time",
    ]
