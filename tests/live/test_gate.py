"""The gate before a real page: who comes in, and what floods do."""

import http.client
import time

import msgspec
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from s2c2a.live.snapshot import Stage
from s2c2a.live.wish import Wish

from live_tabs import until  # type: ignore[import-not-found]

VERSION = "viser-v" + __import__("viser").__version__
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1, 0, 0, 0],
    "position": [1, 1, 1],
    "fov": 0.7,
    "near": 0.01,
    "far": 100,
    "image_height": 800,
    "image_width": 1280,
    "look_at": [0, 0, 0],
    "up_direction": [0, 0, 1],
}


def browser(page, origin: str | None = None, port: int | None = None):
    """A connection that says where it comes from; from the page itself unless stated."""
    port = port or page.gate.port
    return connect(f"ws://127.0.0.1:{port}", origin=origin or page.gate.address, subprotocols=[VERSION], max_size=None)


def answer_to(port: int, host: str, path: str = "/") -> int:
    asked = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    asked.request("GET", path, headers={"Host": host})
    return asked.getresponse().status


def test_the_page_is_for_this_machine_alone(page):
    port = page.gate.port
    assert answer_to(port, f"127.0.0.1:{port}") == 200
    assert answer_to(port, "localhost:9000") == 200  # through ssh -L
    assert answer_to(port, "evil.example") == 403  # a name of theirs that points here
    assert answer_to(port, f"127.0.0.1:{port}", "/../../etc/passwd") == 404


@pytest.mark.parametrize("origin", ["http://evil.example", "http://localhost:3000", "null", "https://127.0.0.1"])
def test_a_page_of_another_origin_is_refused(page, origin):
    with pytest.raises(InvalidStatus, match="403"):
        browser(page, origin)
    assert page.gate.refused["origin"] == 1


def test_nobody_comes_in_behind_the_gate(page):
    behind = page._server.get_port()
    for origin in (page.gate.address, f"http://127.0.0.1:{behind}", "http://evil.example"):
        with pytest.raises(InvalidStatus, match="403"):
            browser(page, origin, port=behind)


def test_who_comes_drives_and_who_goes_stops_the_arm_gently(loop, page):
    with browser(page) as ours:
        ours.send(msgspec.msgpack.encode(CAMERA))
        until(lambda: loop.latest.stage is Stage.DRIVEN, what="driving")
        loop.ask(target=(0.15, 0.0, 0.55))
        until(lambda: loop.latest.error < 0.02, what="arriving")
    until(lambda: loop.latest.stage is Stage.HOLDING, what="holding")
    held = loop.latest
    until(lambda: loop.latest.number > held.number + 8)
    assert np.linalg.norm(loop.latest.states[-1, :3] - held.states[-1, :3]) < 0.02
    until(lambda: loop.latest.stage is Stage.RESTING, what="rest")
    until(lambda: np.linalg.norm(loop.latest.states[-1, :3] - (0, 0, 0.6)) < 0.03, what="standing")


def test_ten_thousand_messages_of_a_flood_are_shown_out_and_the_loop_goes_on(loop, page):
    before, wish = loop.latest.number, loop.wish
    began, sent = time.monotonic(), 0
    random = np.random.default_rng(0)
    while sent < 10_000:
        try:
            with browser(page) as flood:
                for _ in range(10_000 - sent):
                    flood.send(random.bytes(64) if sent % 2 else msgspec.msgpack.encode(CAMERA | {"fov": "wide"}))
                    sent += 1
        except (ConnectionClosed, InvalidStatus):
            continue
    assert page.gate.refused["form"] >= 20
    assert isinstance(loop.wish, Wish)
    assert loop.wish == wish
    steps, took = loop.latest.number - before, time.monotonic() - began
    assert steps > 0.7 * took * loop.arm.control_rate
    assert loop.latest.stage is not Stage.FAILED


def test_a_flood_of_sound_messages_is_shown_out_too(page):
    def send_all(flood) -> None:
        for _ in range(20_000):
            flood.send(msgspec.msgpack.encode(CAMERA))

    with browser(page) as flood, pytest.raises(ConnectionClosed):
        send_all(flood)
    assert page.gate.refused["flood"] == 1
