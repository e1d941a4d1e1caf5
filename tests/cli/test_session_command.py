"""`s2c2a session`, and what `run` says about the age of a model."""

import os
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from s2c2a.arm import load_arm
from s2c2a.cli import run as run_command
from s2c2a.cli.main import main
from s2c2a.strategies import load_session, session_path

FIXTURES = Path(__file__).parents[1] / "fixtures"
TWIN = load_arm("twin_arm")


@pytest.fixture
def weights(tmp_path):
    path = tmp_path / "twin.safetensors"
    path.write_bytes((FIXTURES / "best.safetensors").read_bytes())
    return path


def test_a_recording_becomes_a_report_and_a_file_beside_the_weights(weights, capsys):
    recording = str(FIXTURES / "twin.episodes")
    main(["session", str(weights), "--recording", recording])
    printed = capsys.readouterr().out
    assert "mm from where the model expects it" in printed
    assert load_session(session_path(weights), weights).arm == TWIN.name


def test_the_arm_moves_for_the_given_time(weights, capsys):
    main(["session", str(weights), "--seconds", "6"])
    assert session_path(weights).exists()
    assert weights.with_suffix(".session.episodes").exists()


def test_options_of_the_robot_beside_a_recording_are_refused(weights, capsys):
    recording = str(FIXTURES / "twin.episodes")
    with pytest.raises(SystemExit):
        main(["session", str(weights), "--recording", recording, "--seconds", "9"])
    assert "without --recording" in capsys.readouterr().err


class Homed:
    """A factory of robots that were homed at a time."""

    def __init__(self, calibrated):
        self.calibrated = calibrated

    def make(self, arm):
        return self


@pytest.mark.parametrize(
    ("hours", "warns"), [(1.0, True), (-1.0, False), (None, False)]
)
def test_weights_older_than_the_homing_are_named(weights, capsys, hours, warns):
    trained = datetime(2026, 1, 5, 12, tzinfo=UTC)
    os.utime(weights, times=(trained.timestamp(),) * 2)
    homed = None if hours is None else trained + timedelta(hours=hours)
    run_command._warn_of_age(Homed(homed), TWIN, weights, None)
    assert ("`s2c2a session" in capsys.readouterr().out) == warns
