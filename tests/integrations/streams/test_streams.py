"""Streams: viewers get every step, and never delay or end a run."""

import asyncio
import json
import sys
import time
import warnings

import numpy as np
import pytest

from s2c2a.arm import load_arm
from s2c2a.cli.execution import stream_to
from s2c2a.errors import S2C2AError
from s2c2a.goals import Goal
from s2c2a.integrations.streams.background import shown_in_background
from s2c2a.integrations.streams.foxglove import foxglove_stream
from s2c2a.integrations.streams.rerun import rerun_stream
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


def test_rerun_gets_the_steps(tmp_path):
    pytest.importorskip("rerun")
    from rerun.chunk import RrdReader  # noqa: PLC0415  # an extra

    file = tmp_path / "run.rrd"
    with rerun_stream(ARM, file=str(file)) as on_step:
        for number in range(3):
            on_step(record(number))
    chunks = [
        chunk.to_record_batch()
        for chunk in RrdReader(file).stream()
        if chunk.entity_path == "/numbers/actions" and not chunk.is_static
    ]
    rows = [row for each in chunks for row in each["Scalars:scalars"].to_pylist()]
    firsts = sorted(row[0] for row in rows)
    np.testing.assert_allclose(firsts, [0.0, 0.001, 0.002])


def test_two_places_for_rerun_are_refused():
    pytest.importorskip("rerun")
    both = rerun_stream(ARM, url="rerun+http://127.0.0.1:1/proxy", file="a.rrd")
    with pytest.raises(S2C2AError, match="leave one out"), both:
        pass


def test_a_recording_is_replaced_on_request_alone(tmp_path):
    pytest.importorskip("rerun")
    file = tmp_path / "run.rrd"
    file.write_text("mine")
    with (
        pytest.raises(S2C2AError, match=r"exists; .*run\.rrd,overwrite=true"),
        stream_to(f"rerun,file={file}", ARM),
    ):
        pass
    assert file.read_text() == "mine"
    with stream_to(f"rerun,file={file},overwrite=true", ARM) as on_step:
        on_step(record(0))
    assert file.read_bytes().startswith(b"RRF")


def test_a_recording_does_not_replace_a_file_of_another_kind(tmp_path):
    pytest.importorskip("rerun")
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    with (
        pytest.raises(S2C2AError, match=r"does not end in \.rrd"),
        rerun_stream(ARM, file=str(file), overwrite=True),
    ):
        pass
    assert file.read_text() == "mine"


@pytest.mark.parametrize("name", ["file/run.rrd", "n" * 300])
def test_a_recording_that_cannot_be_written_is_named(tmp_path, name):
    pytest.importorskip("rerun")
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(S2C2AError, match=r"cannot write .*; choose a place"),
        rerun_stream(ARM, file=str(tmp_path / name)),
    ):
        pass


def test_overwrite_needs_a_file():
    pytest.importorskip("rerun")
    with (
        pytest.raises(S2C2AError, match=r"add file=run\.rrd"),
        rerun_stream(ARM, overwrite=True),
    ):
        pass


def test_without_a_viewer_rerun_says_what_to_do(monkeypatch, tmp_path):
    pytest.importorskip("rerun")
    # neither on the path nor beside Python; one that is there may take time to end
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with (
        pytest.raises(S2C2AError, match=r"--stream rerun,file=run\.rrd"),
        rerun_stream(ARM),
    ):
        pass


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


def test_foxglove_gets_the_steps(capsys):
    pytest.importorskip("foxglove")
    with foxglove_stream(ARM, port=0) as on_step:
        address = capsys.readouterr().out.split(", ")[1].strip()
        assert address.startswith("ws://127.0.0.1:")
        content = asyncio.run(asyncio.wait_for(first_message(address, on_step), 20))
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


def test_foxglove_accepts_any_origin_and_offers_nothing_that_commands(capsys):
    pytest.importorskip("foxglove")
    with foxglove_stream(ARM, port=0):
        address = capsys.readouterr().out.split(", ")[1].strip()
        info = asyncio.run(asyncio.wait_for(server_info(address), 20))
    assert info["op"] == "serverInfo"
    assert info["capabilities"] == []


def test_a_port_that_is_taken_is_an_error():
    pytest.importorskip("foxglove")
    import socket  # noqa: PLC0415

    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(S2C2AError, match="choose another one"),
            foxglove_stream(ARM, port=port),
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
