"""Streams: viewers get every step, and never delay or end a run."""

import asyncio
import json
import socket
import time
import warnings

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.execution import stream_to
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.integrations.streams.background import shown_in_background
from s2c2a.runtime import StepRecord
from s2c2a.spaces import Reading, Stage

ARM = load_arm("twin_arm")
STATES = np.array([[0, 0, 0.1 * (n + 1), 0, 0, 1] for n in range(ARM.module_count)])
TARGET = [0.1, 0.0, 0.3]


def record(number, start=0.0):
    """A step with a target at the tip."""
    seconds = start + number / 10
    goal = Goal.of(ARM.module_count).with_position(TARGET)
    action = np.full((ARM.module_count, ARM.cable_count), 0.001 * number)
    reading = Reading(seconds, {"states": STATES})
    return StepRecord(number, seconds, Stage.RUN, reading, goal, action)


def test_times_go_on_when_another_run_begins():
    scenes = []
    with shown_in_background(ARM, scenes.append) as on_step:
        for number in (0, 1, 2, 0, 1):
            on_step(record(number))
    times = [scene.time for scene in scenes]
    np.testing.assert_allclose(times, [0.0, 0.1, 0.2, 0.3, 0.4])
    np.testing.assert_allclose(scenes[0].targets[ARM.module_count], TARGET)


def test_a_slow_viewer_does_not_delay_a_step():
    shown = []

    def slow(scene):
        time.sleep(0.003)
        shown.append(scene)

    with shown_in_background(ARM, slow) as on_step:
        begin = time.perf_counter()
        for number in range(1000):
            on_step(record(0, number))
        per_step = (time.perf_counter() - begin) / 1000
    assert per_step < 0.005
    assert 0 < len(shown) < 1000


def test_an_error_of_a_viewer_is_a_warning():
    def broken(scene):
        raise ValueError("no display")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with shown_in_background(ARM, broken) as on_step:
            on_step(record(0))
            on_step(record(1))
    texts = [str(each.message) for each in caught]
    assert texts == ["the run is not shown any more: ValueError: no display"]


@pytest.fixture
def served(capsys):
    """A stream to Foxglove: its address, and the function of its steps."""
    pytest.importorskip("foxglove")
    with stream_to("foxglove,port=0", ARM) as on_step:
        address = capsys.readouterr().out.split(", ")[1].strip()
        assert address.startswith("ws://127.0.0.1:")
        yield address, on_step


async def first_message(address, on_step):
    """The first message of the topic of steps, as Foxglove would ask for it."""
    websockets = pytest.importorskip("websockets")
    protocols = ["foxglove.sdk.v1"]
    async with websockets.connect(address, subprotocols=protocols) as client:
        channels = []
        while not any(each["topic"] == "/step" for each in channels):
            answer = json.loads(await client.recv())
            channels += answer.get("channels", [])
        (channel,) = (each["id"] for each in channels if each["topic"] == "/step")
        wanted = [{"id": 7, "channelId": channel}]
        await client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        for number in range(100):
            on_step(record(number))
            try:
                content = await asyncio.wait_for(client.recv(), 0.1)
            except TimeoutError:
                continue
            if isinstance(content, bytes) and content[0] == 1:
                return content
    raise AssertionError("no message came")


def test_foxglove_gets_the_steps(served):
    content = asyncio.run(asyncio.wait_for(first_message(*served), 20))
    assert int.from_bytes(content[1:5], "little") == 7
    step = json.loads(content[13:])
    assert step["actions_1_1"] == pytest.approx(0.001 * round(step["time"] * 10))
    assert step["desired_positions_3_x"] == pytest.approx(TARGET[0])


async def server_info(address):
    """What the server says of itself, to a page of another origin."""
    websockets = pytest.importorskip("websockets")
    async with websockets.connect(
        address, subprotocols=["foxglove.sdk.v1"], origin="http://elsewhere.example"
    ) as client:
        return json.loads(await client.recv())


def test_foxglove_accepts_any_origin_and_offers_nothing_that_commands(served):
    info = asyncio.run(asyncio.wait_for(server_info(served[0]), 20))
    assert info["op"] == "serverInfo"
    assert info["capabilities"] == []


def test_a_port_that_is_taken_is_an_error():
    pytest.importorskip("foxglove")
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(S2C2AError, match="choose another one"),
            stream_to(f"foxglove,port={port}", ARM),
        ):
            pass


def test_a_stream_of_a_users_file_gets_options_of_their_types(tmp_path, monkeypatch):
    code = (
        "from contextlib import contextmanager\n"
        "@contextmanager\n"
        "def mine(arm, size: int = 1):\n"
        "    yield [size, arm.name].append\n"
    )
    (tmp_path / "own_stream.py").write_text(code)
    monkeypatch.chdir(tmp_path)
    with stream_to("own_stream.py:mine,size=3", ARM) as on_step:
        assert on_step.__self__ == [3, "twin_arm"]
    with (
        pytest.raises(S2C2AError, match="no option 'color'"),
        stream_to("own_stream.py:mine,color=3", ARM),
    ):
        pass


def test_a_stream_that_is_not_known_is_an_error():
    with pytest.raises(S2C2AError, match="no stream 'rviz'"), stream_to("rviz", ARM):
        pass


def test_without_a_stream_steps_are_ignored():
    with stream_to("", ARM) as on_step:
        assert on_step(record(0)) is None
