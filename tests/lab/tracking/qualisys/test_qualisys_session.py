"""Commands of a session, in simulated time."""

import pytest

from s2c2a.lab.tracking.qualisys.packets import StreamParameters
from s2c2a.lab.tracking.qualisys.session import LOST, PERIOD, QtmSession

BODIES = StreamParameters(("base",), "+z")


@pytest.fixture
def session():
    one = QtmSession("lab:22223")
    one.connect(0.0)
    return one


@pytest.fixture
def streaming(session):
    session.due_commands(0.0)
    session.take_command("Version set to 1.20", 0.0)
    session.due_commands(0.0)
    session.take_parameters(BODIES, 0.0)
    session.due_commands(0.0)
    session.take_frame(0.0)
    return session


def test_while_frames_arrive_nothing_is_requested(streaming):
    streaming.take_frame(0.9)
    assert streaming.due_commands(1.5) == []
    assert streaming.problem == ""


def test_after_a_silence_everything_is_requested_again(streaming):
    commands = streaming.due_commands(PERIOD + 0.5)
    assert commands == ["GetParameters 3D 6D", "StreamFrames AllFrames 6D"]
    assert streaming.is_outdated
    assert "sends no frames" in streaming.problem


def test_a_long_silence_loses_the_connection(streaming):
    assert not streaming.is_lost(LOST)
    assert streaming.is_lost(LOST + 0.1)
    streaming.lose()
    assert "lab:22223 does not answer" in streaming.problem


def test_the_end_of_a_measurement_and_events_outdate_the_names(streaming):
    streaming.take_event(14, 0.1)
    assert not streaming.is_outdated
    streaming.take_event(3, 0.1)
    assert streaming.is_outdated
    streaming.request_parameters(0.2)
    assert streaming.due_commands(0.2) == ["GetParameters 3D 6D"]
    streaming.take_parameters(BODIES, 0.3)
    streaming.take_no_data(0.4)
    assert streaming.is_outdated
    assert "start a measurement" in streaming.problem


@pytest.mark.parametrize("take", [QtmSession.take_command, QtmSession.take_error])
def test_a_version_that_is_missing_is_named(session, take):
    take(session, "Version NOT supported", 0.1)
    assert session.is_refused
    session.lose()
    assert "does not have version 1.20" in session.problem


def test_a_refusal_is_reported_in_the_words_of_qtm(session):
    session.take_error("Connection refused. Max number of clients reached.", 0.1)
    session.lose()
    assert "Max number of clients" in session.problem


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (StreamParameters((), "+z"), "no 6DOF bodies"),
        (StreamParameters(("base",), "-x"), "the axis -x up"),
    ],
)
def test_unusable_parameters_are_reported_and_requested_again(
    session, parameters, words
):
    session.due_commands(0.0)
    session.take_command("Version set to 1.20", 0.0)
    session.due_commands(0.0)
    session.take_parameters(parameters, 0.1)
    assert words in session.problem
    assert not session.is_connected
    assert session.due_commands(PERIOD) == ["GetParameters 3D 6D"]
