"""The gate before a real page: who comes in, and what floods do."""

import http.client
import time

import msgspec
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from s2c2a.live.gate import STOP, STOP_HEADER
from s2c2a.spaces import Stage

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
    return connect(
        f"ws://127.0.0.1:{port}",
        origin=origin or page.gate.address,
        subprotocols=[VERSION],
        max_size=None,
    )


def answer_to(port: int, host: str, path: str = "/", *more: tuple[str, str]) -> int:
    asked = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    asked.putrequest("GET", path, skip_host=True)
    for name, value in (("Host", host), *more):
        asked.putheader(name, value)
    asked.endheaders()
    return asked.getresponse().status


def test_the_page_is_for_this_machine_alone(page):
    port = page.gate.port
    assert answer_to(port, f"127.0.0.1:{port}") == 200
    assert answer_to(port, "localhost:9000") == 200  # through ssh -L
    assert answer_to(port, "evil.example") == 403  # a name of theirs that points here
    assert answer_to(port, f"127.0.0.1:{port}", "/../../etc/passwd") == 404


def test_a_host_that_only_looks_like_this_machine_is_refused(page):
    for host in (
        "evil.com@127.0.0.1",
        "127.0.0.1.evil.com",
        "127.0.0.1:80@evil.com",
        "",
        "localhost:",
        "[::1",
        "127.1",
    ):
        assert answer_to(page.gate.port, host) == 403, host


def test_a_header_that_is_said_twice_is_a_bad_request(page):
    host = f"127.0.0.1:{page.gate.port}"
    assert answer_to(page.gate.port, host, "/", ("Host", host)) == 400
    for name in ("Upgrade", "Origin", "Connection", "Accept-Encoding"):
        assert (
            answer_to(
                page.gate.port, host, "/", (name, "websocket"), (name, "websocket")
            )
            == 400
        ), name
    assert page.gate.refused["twice"] == 5


def test_our_own_page_stops_the_arm_and_no_other_one_does(control, page):
    host = f"127.0.0.1:{page.gate.port}"
    control.ask(driven=True)
    until(lambda: control.latest.stage is Stage.RUN, what="running")
    # an image, a link, a form of another page: no header of ours
    assert answer_to(page.gate.port, host, STOP) == 403
    assert not control.request.stopped
    assert answer_to(page.gate.port, "evil.example", STOP, (STOP_HEADER, "1")) == 403
    assert answer_to(page.gate.port, host, STOP, (STOP_HEADER, "1")) == 200
    assert control.request.stopped
    until(lambda: control.latest.stage is Stage.HOLD, what="the stop")


def test_a_page_of_another_origin_is_refused(page):
    for origin in (
        "http://evil.example",
        "http://localhost:3000",
        "null",
        "https://127.0.0.1",
    ):
        with pytest.raises(InvalidStatus, match="403"):
            browser(page, origin)
    assert page.gate.refused["origin"] == 4


def test_nobody_comes_in_behind_the_gate(page):
    behind = page.server.get_port()
    for origin in (
        page.gate.address,
        f"http://127.0.0.1:{behind}",
        "http://evil.example",
    ):
        with pytest.raises(InvalidStatus, match="403"):
            browser(page, origin, port=behind)


def test_who_comes_drives_and_who_goes_stops_the_arm_gently(control, page):
    rows = []
    control.watch(rows.append)
    with browser(page) as ours:
        ours.send(msgspec.msgpack.encode(CAMERA))
        until(lambda: control.latest.stage is Stage.RUN, what="driving")
        control.ask(target=(0.15, 0.0, 0.55))
        until(
            lambda: (
                np.linalg.norm(control.latest.states[-1, :3] - (0.15, 0.0, 0.55)) < 0.02
            ),
            what="arriving",
        )
    until(lambda: control.latest.stage is Stage.IDLE, what="rest")
    held = np.array([row.states[-1, :3] for row in rows if row.stage is Stage.HOLD])
    assert len(held) > 10
    assert np.linalg.norm(held[-1] - held[5]) < 0.02  # it arrived with some speed
    until(
        lambda: np.linalg.norm(control.latest.states[-1, :3] - (0, 0, 0.6)) < 0.03,
        what="standing",
    )


def test_ten_thousand_messages_of_a_flood_are_shown_out_and_the_arm_goes_on(
    control, page
):
    before, request = control.latest.step.number, control.request
    began, sent = time.monotonic(), 0
    random = np.random.default_rng(0)
    while sent < 10_000:
        try:
            with browser(page) as flood:
                for _ in range(10_000 - sent):
                    flood.send(
                        random.bytes(64)
                        if sent % 2
                        else msgspec.msgpack.encode(CAMERA | {"fov": "wide"})
                    )
                    sent += 1
        except (ConnectionClosed, InvalidStatus):
            continue
    assert page.gate.refused["form"] >= 20
    assert control.request == request
    steps, took = control.latest.step.number - before, time.monotonic() - began
    assert steps > 0.7 * took * control.arm.control_rate
    assert control.latest.stage is not Stage.FAULT


def test_a_flood_of_sound_messages_is_shown_out_too(page):
    def send_all(flood) -> None:
        for _ in range(20_000):
            flood.send(msgspec.msgpack.encode(CAMERA))

    with browser(page) as flood, pytest.raises(ConnectionClosed):
        send_all(flood)
    assert page.gate.refused["flood"] == 1
