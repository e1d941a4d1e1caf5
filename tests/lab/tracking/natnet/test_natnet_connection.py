"""Requests of a connection, in simulated time."""

from itertools import pairwise

import pytest

from s2c2a.lab.tracking.natnet.connection import (
    KEEP_ALIVE_PERIOD,
    SILENCE,
    Connection,
)
from s2c2a.lab.tracking.natnet.layouts import Version
from s2c2a.lab.tracking.natnet.messages import MessageKind, ServerInfo
from s2c2a.lab.tracking.receiving import FIRST_PAUSE, LONGEST_PAUSE

INFO = ServerInfo(Version(4, 1), None)


@pytest.fixture
def connection():
    return Connection("lab:1510")


@pytest.fixture
def connected(connection):
    connection.due_request(0.0)
    connection.take_server_info(INFO, 0.0)
    connection.due_request(0.0)
    connection.take_definitions({1: "base"}, 0.0)
    connection.take_frame(0.0)
    return connection


def requests(connection, start, end, step=0.01):
    times = [start + step * number for number in range(round((end - start) / step))]
    pairs = [(time, connection.due_request(time)) for time in times]
    return [(time, kind) for time, kind in pairs if kind is not None]


def test_without_an_answer_pauses_double_up_to_a_limit(connection):
    times = [time for time, _ in requests(connection, 0.0, 20.0)]
    pauses = [later - time for time, later in pairwise(times)]
    assert pauses[:3] == pytest.approx([FIRST_PAUSE, 0.2, 0.4], abs=0.02)
    assert pauses[-1] == pytest.approx(LONGEST_PAUSE, abs=0.02)
    assert "lab:1510 does not answer" in connection.problem


def test_names_are_requested_after_the_version(connection):
    assert connection.due_request(0.0) is MessageKind.CONNECT
    connection.take_server_info(INFO, 0.0)
    assert connection.due_request(0.0) is MessageKind.REQUEST_DEFINITIONS
    assert not connection.is_connected
    assert "sends no frames" in connection.problem


def test_a_connection_is_kept_alive(connected):
    kinds = {kind for _, kind in requests(connected, 0.0, SILENCE)}
    assert kinds == {MessageKind.KEEP_ALIVE}
    assert connected.is_connected
    assert connected.problem == ""
    assert requests(connected, 0.9, 1.0) == []


def test_after_a_silence_the_version_is_requested_again(connected):
    (_, kind), *_ = requests(connected, SILENCE + 0.01, SILENCE + 0.02)
    assert kind is MessageKind.CONNECT
    assert not connected.is_connected
    assert "does not answer" in connected.problem


def test_changed_bodies_are_requested_once_in_a_period(connected):
    connected.take_frame(0.6)
    connected.due_request(0.6)
    for _ in range(3):
        connected.request_definitions(0.7)
    connected.take_frame(1.2)
    found = requests(connected, 0.7, 1.15)
    assert [kind for _, kind in found][:1] == [MessageKind.REQUEST_DEFINITIONS]
    assert found[0][0] == pytest.approx(0.6 + KEEP_ALIVE_PERIOD, abs=0.02)
    assert connected.is_connected


def test_a_frame_before_the_handshake_shortens_the_pause(connection):
    requests(connection, 0.0, 10.0)
    connection.request_soon(10.0)
    assert len(requests(connection, 10.0, 10.0 + FIRST_PAUSE + 0.02)) >= 1


def test_a_name_that_two_bodies_have_is_left_out(connected):
    connected.take_definitions({1: "base", 2: "end-1", 3: "end-1"}, 0.1)
    assert connected.names == {1: "base"}
