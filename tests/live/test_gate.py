"""Gate in front of a real page: access control and rate limits."""

import http.client
import time
from contextlib import contextmanager

import msgspec
import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from s2c2a.errors import S2C2AError
from s2c2a.live.gate import STOP, STOP_HEADER
from s2c2a.live.window import Window
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
    """A websocket with an origin, by default the page's own."""
    port = port or page.gate.port
    return connect(
        f"ws://127.0.0.1:{port}",
        origin=origin or page.gate.address,
        subprotocols=[VERSION],
        max_size=None,
        max_queue=None,  # it reads nothing, but must see the end of the connection
    )


@contextmanager
def driving(page):
    """A browser that has sent its camera, and so drives if no other does."""
    with browser(page) as connection:
        connection.send(msgspec.msgpack.encode(CAMERA))
        yield connection


def status_of(port: int, host: str, path: str = "/", *more: tuple[str, str]) -> int:
    """Status code of a plain request."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in (("Host", host), *more):
        connection.putheader(name, value)
    connection.endheaders()
    return connection.getresponse().status


@pytest.mark.parametrize("port", [-60, 70_000])
def test_a_port_that_does_not_exist_is_refused(twin, port):
    with pytest.raises(S2C2AError, match=rf"no free port from {port} .*to 65535"):
        Window(twin).open(port)


def test_the_page_is_served_to_this_machine_only(page):
    port = page.gate.port
    assert status_of(port, f"127.0.0.1:{port}") == 200
    assert status_of(port, "localhost:9000") == 200  # through ssh -L
    assert status_of(port, "evil.example") == 403  # DNS rebinding
    assert status_of(port, f"127.0.0.1:{port}", "/../../etc/passwd") == 404


def test_a_host_that_only_resembles_this_machine_is_refused(page):
    for host in (
        "evil.com@127.0.0.1",
        "127.0.0.1.evil.com",
        "127.0.0.1:80@evil.com",
        "",
        "localhost:",
        "[::1",
        "127.1",
    ):
        assert status_of(page.gate.port, host) == 403, host


def test_a_duplicate_header_is_a_bad_request(page):
    host = f"127.0.0.1:{page.gate.port}"
    assert status_of(page.gate.port, host, "/", ("Host", host)) == 400
    for name in ("Upgrade", "Origin", "Connection", "Accept-Encoding"):
        header = (name, "websocket")
        assert status_of(page.gate.port, host, "/", header, header) == 400, name
    assert page.gate.refused["duplicate"] == 5


def test_only_our_page_can_stop_the_arm(control, page):
    host = f"127.0.0.1:{page.gate.port}"
    control.ask(driven=True)
    until(lambda: control.latest.stage is Stage.RUN, what="running")
    # an image, a link or a form of another page cannot send the header
    assert status_of(page.gate.port, host, STOP) == 403
    assert not control.request.stopped
    assert status_of(page.gate.port, "evil.example", STOP, (STOP_HEADER, "1")) == 403
    assert status_of(page.gate.port, host, STOP, (STOP_HEADER, "1")) == 200
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


def test_viser_accepts_connections_of_the_gate_only(page):
    viser_port = page.server.get_port()
    for origin in (
        page.gate.address,
        f"http://127.0.0.1:{viser_port}",
        "http://evil.example",
    ):
        with pytest.raises(InvalidStatus, match="403"):
            browser(page, origin, port=viser_port)


@pytest.mark.slow
def test_a_browser_drives_on_arrival_and_the_arm_holds_when_it_leaves(control, page):
    rows = []
    control.watch(rows.append)
    with driving(page):
        until(lambda: control.latest.stage is Stage.RUN, what="driving")
        # arcs, with which the light strategy plans, err by 0.9 cm here
        control.ask(target=(0.05, 0.0, 0.6))
        until(
            lambda: (
                np.linalg.norm(control.latest.states[-1, :3] - (0.05, 0.0, 0.6)) < 0.02
            ),
            what="arriving",
        )
        arrived = len(rows)
        until(lambda: len(rows) > arrived + 30, what="the end of the vibration")
    until(lambda: control.latest.stage is Stage.IDLE, what="rest")
    holding = np.array([row.states[-1, :3] for row in rows if row.stage is Stage.HOLD])
    assert len(holding) > 10
    assert (
        np.linalg.norm(holding[-1] - holding[5]) < 0.02
    )  # it was still moving at the stop
    until(
        lambda: np.linalg.norm(control.latest.states[-1, :3] - (0, 0, 0.6)) < 0.03,
        what="the straight arm",
    )


def test_malformed_messages_are_refused_and_the_arm_keeps_running(control, page):
    first = control.latest.step.number
    request = control.request
    start = time.monotonic()
    sent = 0
    random = np.random.default_rng(0)
    malformed = msgspec.msgpack.encode(CAMERA | {"fov": "wide"})
    while sent < 3_000:
        try:
            with browser(page) as flood:
                for _ in range(3_000 - sent):
                    flood.send(random.bytes(64) if sent % 2 else malformed)
                    sent += 1
        except (ConnectionClosed, InvalidStatus):
            continue
    assert page.gate.refused["form"] >= 20
    assert control.request == request
    steps = control.latest.step.number - first
    elapsed = time.monotonic() - start
    assert steps > 0.7 * elapsed * control.arm.control_rate
    assert control.latest.stage is not Stage.FAULT


def test_a_flood_of_valid_messages_is_disconnected(page):
    def send_all(flood) -> None:
        for _ in range(20_000):
            flood.send(msgspec.msgpack.encode(CAMERA))

    with browser(page) as flood, pytest.raises(ConnectionClosed):
        send_all(flood)
    assert page.gate.refused["flood"] == 1


def test_a_page_that_listens_on_all_addresses_keeps_its_checks(twin):
    opened = Window(twin).open(0, host="0.0.0.0")
    try:
        port = opened.gate.port
        assert status_of(port, f"localhost:{port}") == 200
        assert status_of(port, f"192.168.1.10:{port}") == 403
        address = f"http://192.168.1.10:{port}"
        with pytest.raises(InvalidStatus):
            browser(opened, origin=address)
    finally:
        opened.close()


def steering(page):
    """A connection that steers, as the page of a browser opens it."""
    return connect(f"ws://127.0.0.1:{page.gate.port}/steer", origin=page.gate.address)


def steer(connection, key, direction):
    message = {"key": key, "direction": direction}
    connection.send(msgspec.json.encode(message).decode())


def test_the_browser_that_drives_steers_the_target_at_a_limited_speed(control, page):
    with driving(page), steering(page) as keys:
        until(lambda: control.latest.stage is Stage.RUN, what="driving")
        until(lambda: control.request.target is not None, what="a target")
        before = np.array(control.request.target)
        (panel,) = page._panels.values()
        began = time.monotonic()
        while time.monotonic() < began + 0.5:
            steer(keys, panel.steering_key, [0.0, 1.0, 0.0])
            time.sleep(0.05)
        until(lambda: page._steering.direction() is None, what="the end")
        lasted = time.monotonic() - began
        moved = np.subtract(control.request.target, before)
        # away from a camera on the diagonal, level
        assert moved[0] == pytest.approx(moved[1], abs=1e-6)
        # it starts at the tip, and stays within the arm's length
        assert -0.02 < moved[2] <= 1e-6
        assert -0.15 * (lasted + 0.1) * np.sqrt(0.5) < moved[0] < -0.02
        held = control.request.target
        time.sleep(0.2)
        assert control.request.target == held


def test_only_the_key_of_the_driver_steers(control, page):
    with driving(page), steering(page) as keys:
        until(lambda: control.request.target is not None, what="a target")
        before = control.request.target
        for _ in range(5):
            steer(keys, "0" * 32, [1.0, 0.0, 0.0])
            time.sleep(0.05)
        assert control.request.target == before


def test_a_page_of_another_origin_does_not_steer(page):
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws://127.0.0.1:{page.gate.port}/steer", origin="http://evil.example")


@pytest.mark.parametrize(
    "text",
    [
        "{}",
        '{"key": "a", "direction": [9, 0, 0]}',
        '{"key": "a", "direction": [NaN, 0, 0]}',
        '{"key": "a", "direction": [0, 0]}',
        "[" * 5000,
    ],
)
def test_steering_of_another_form_is_refused(text, page):
    with steering(page) as keys:
        keys.send(text)
        until(lambda: page.gate.refused["form"] == 1, what="the refusal")
