"""`s2c2a session`, and what `run` says about the age of a model."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest

from s2c2a import api, strategies
from s2c2a.arm import load_arm
from s2c2a.cli import run as run_command
from s2c2a.cli import session as session_command
from s2c2a.cli.main import main
from s2c2a.errors import RecordingError
from s2c2a.strategies import load_session, save_session, session_path

FIXTURES = Path(__file__).parents[1] / "fixtures"
TWIN = load_arm("twin_arm")


@pytest.fixture
def weights(tmp_path):
    path = tmp_path / "twin.safetensors"
    path.write_bytes((FIXTURES / "best.safetensors").read_bytes())
    return path


@pytest.mark.slow
def test_a_recording_becomes_a_report_and_a_file_as_old_as_itself_beside_the_weights(
    weights, tmp_path, capsys
):
    recorded = datetime(2026, 1, 5, 12, tzinfo=UTC)
    recording = tmp_path / "day.episodes"
    recording.write_bytes((FIXTURES / "twin.episodes").read_bytes())
    os.utime(recording, times=(recorded.timestamp(),) * 2)
    main(["session", str(weights), "--recording", str(recording)])
    printed = capsys.readouterr().out
    assert "mm from where the model expects it" in printed
    session = load_session(session_path(weights), weights)
    assert (session.arm, session.date) == (TWIN.name, recorded)
    # one that predicts no better makes way, and is not lost
    change = session.change.model_copy(update={"translation": (0.5, 0.0, 0.0)})
    earlier = session.model_copy(update={"change": change, "improves": True})
    save_session(earlier, session_path(weights))
    main(["session", str(weights), "--recording", str(recording)])
    assert "the earlier session is kept" in capsys.readouterr().out
    assert load_session(session_path(weights), weights) == session
    kept = session_path(weights).with_suffix(".earlier.json")
    assert load_session(kept, weights) == earlier
    # as does one of another training
    other = earlier.model_copy(update={"weights": 64 * "0"})
    save_session(other, session_path(weights))
    main(["session", str(weights), "--recording", str(recording)])
    assert load_session(session_path(weights), weights) == session


@pytest.mark.slow
def test_the_arm_moves_for_the_given_time(weights, capsys):
    main(["session", str(weights), "--seconds", "12"])
    assert session_path(weights).exists()
    assert weights.with_suffix(".session.episodes").exists()


@pytest.mark.parametrize("seconds", ["nan", "inf", "0", "-1", "9.9", "1e10"])
def test_impossible_times_move_nothing(weights, seconds, refusal):
    assert "--seconds" in refusal("session", str(weights), "--seconds", seconds)
    assert not weights.with_suffix(".session.episodes").exists()


def test_an_arm_whose_tip_is_not_seen_does_not_move(weights, monkeypatch):
    robot = SimpleNamespace(sensors=frozenset({"cables"}))
    blind = SimpleNamespace(make=lambda arm: robot)
    monkeypatch.setattr(session_command, "robot_factory_for", lambda *_, **__: blind)
    with pytest.raises(RecordingError, match="turn on the tracking"):
        session_command.session(weights)
    assert not weights.with_suffix(".session.episodes").exists()


def test_networks_of_the_package_are_no_file(refusal):
    assert "a file is needed" in refusal("session", "shipped")


@pytest.mark.parametrize(
    ("hours", "warns"), [(1.0, True), (-1.0, False), (None, False)]
)
def test_weights_older_than_the_homing_are_named(weights, capsys, hours, warns):
    trained = datetime(2026, 1, 5, 12, tzinfo=UTC)
    os.utime(weights, times=(trained.timestamp(),) * 2)
    homed = None if hours is None else trained + timedelta(hours=hours)
    robot = SimpleNamespace(last_calibration=lambda: homed)
    factory = SimpleNamespace(make=lambda arm: robot)
    run_command._warn_of_age(factory, TWIN, weights, None)
    assert ("`s2c2a session" in capsys.readouterr().out) == warns


def test_a_motion_that_fails_replaces_no_earlier_one(weights, refusal):
    motion = weights.with_suffix(".session.episodes")
    motion.write_bytes((FIXTURES / "twin.episodes").read_bytes())
    before = sorted(weights.parent.iterdir())
    failing = ("--robot-option", "events=0 homing_error 1.5")
    assert "diverged" in refusal("session", str(weights), "--seconds", "10", *failing)
    assert sorted(weights.parent.iterdir()) == before
    assert motion.read_bytes() == (FIXTURES / "twin.episodes").read_bytes()


def test_a_session_that_fails_after_its_motion_replaces_no_file(
    weights, monkeypatch, refusal
):
    for ending in (".session.episodes", ".session.json"):
        weights.with_suffix(ending).write_bytes(b"of the day before")
    before = {file: file.read_bytes() for file in weights.parent.iterdir()}
    seen = []

    def moved(arm, path, **_):
        Path(path).write_bytes(b"of today")
        return seen.append(path)

    def fails(*_):
        raise RecordingError("the tip was seen in 50 samples of this recording")

    monkeypatch.setattr(api, "collect", moved)
    monkeypatch.setattr(strategies, "measured_session", fails)
    assert "50 samples" in refusal("session", str(weights))
    assert len(seen) == 1
    assert {file: file.read_bytes() for file in weights.parent.iterdir()} == before
