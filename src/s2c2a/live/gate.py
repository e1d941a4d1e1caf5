"""Access control in front of viser: who may connect, and which messages pass.

viser does not check origins, so any page in the same browser could drive the arm. The
gate listens on 127.0.0.1 by default, accepts only pages that it served itself under a
name of this machine, and passes only messages of known form at a limited rate. viser
listens behind it on another port of 127.0.0.1 and accepts websockets from the gate
only, which sends a secret as their origin.

The gate serves the page, so it also adds the Stop button, which works independently of
viser, and keeps keys of the panel from the camera. Keys and gamepads that steer the
target come over a connection of their own, which ends here.
"""

import asyncio
import gzip
import http
import logging
import re
import threading
import time
import urllib.request
from collections import Counter, deque
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager, suppress
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

from websockets import Headers
from websockets.asyncio import server
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.http11 import Request, Response
from websockets.typing import Origin, Subprotocol

from s2c2a.errors import S2C2AError
from s2c2a.live.messages import MAX_BYTES, is_valid, steering_of
from s2c2a.live.request import Point

HOST = "127.0.0.1"
LOCAL = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.ASCII)
UNIQUE_HEADERS = ("Host", "Origin", "Upgrade", "Accept-Encoding", "Connection")
STOP = "/stop"
STOP_HEADER = "S2C2A-Stop"
STEER = "/steer"
STOP_BUTTON = Path(__file__).with_name("stop_button.html")
PANEL_KEYS = Path(__file__).with_name("panel_keys.html")
STEERING = Path(__file__).with_name("steering.html")
NO_RESPONSE = "No response: cut the power"
MAX_CONNECTIONS = 16
# messages of one browser within a time [s]; a drag or a turn sends 20 a second
BURST = 200
WITHIN = 2.0
MAX_REFUSED = 20  # malformed messages after which the connection is closed
CLOSE_TIMEOUT = 0.3  # s
TRIED_PORTS = 50
STATUS_CODES = {"duplicate": 400, "host": 403, "origin": 403, "full": 503, "path": 404}
CLOSE_REASONS = {"flood": "too many messages", "form": "malformed messages"}

_QUIET = logging.getLogger("s2c2a.gate")
_QUIET.setLevel(logging.CRITICAL)  # websockets logs plain requests as errors
_BROWSER_OPTIONS: dict[str, Any] = {
    "compression": None,
    "close_timeout": CLOSE_TIMEOUT,
    "max_size": MAX_BYTES,
    "max_queue": 8,
    "logger": _QUIET,
    # s; detect a lost browser
    "ping_interval": 3.0,
    "ping_timeout": 5.0,
}
_VISER_OPTIONS: dict[str, Any] = {
    "compression": None,
    "close_timeout": CLOSE_TIMEOUT,
    "max_size": None,
    "max_queue": 4,
    "ping_interval": None,
}
_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Connection": "close",
}


def only_with(secret: str) -> AbstractContextManager:
    """Context in which started websocket servers accept only the secret as origin."""
    restricted = partial(server.serve, origins=[Origin(secret)])
    return patch.object(server, "serve", restricted)


class Gate:
    """Proxy in front of a viser server, in a separate thread.

    Attributes:
        port: of the page.
        address: of the page.
        refused: number of refused connections and messages, by reason.
    """

    def __init__(
        self,
        port: int,
        viser_port: int,
        secret: str,
        on_stop: Callable[[], str] | None,
        host: str,
        on_steer: Callable[[str, Point], None] | None,
    ):
        """Listen on `port`, or on the next free port after it.

        Args:
            port: of the page.
            viser_port: of the viser server.
            secret: origin that viser accepts.
            on_stop: stops the arm; returns the text that the Stop button then shows, or
                nothing if the arm did not obey. No Stop button if None.
            host: address to listen on. Whatever it is, browsers must name the page as
                localhost or 127.0.0.1.
            on_steer: gets the key of a panel, and a direction to the right, forward and
                upward in parts of the largest speed. No steering if None.

        Raises:
            S2C2AError: no port is free, or viser does not respond.
        """
        self.port = port
        self._host = host
        self.refused = Counter[str]()
        self._viser_port = viser_port
        self._secret = secret
        self._connections = 0
        self._on_stop = on_stop
        self._on_steer = on_steer
        button = b"" if on_stop is None else STOP_BUTTON.read_bytes()
        steering = b"" if on_steer is None else STEERING.read_bytes()
        added = PANEL_KEYS.read_bytes() + button + steering
        self._page = _page_of(viser_port, added)
        self._closing = asyncio.Event()
        opened = Future[tuple[int, asyncio.AbstractEventLoop]]()
        self._thread = threading.Thread(
            target=asyncio.run, args=(self._serve(opened),), name="gate", daemon=True
        )
        self._thread.start()
        try:
            self.port, self._loop = opened.result(10.0)
        except OSError as error:
            # a timeout is an OSError without a message
            reason = str(error) or "the gate did not open within 10 s"
            raise S2C2AError(f"the page cannot be served: {reason}") from error
        self.address = f"http://{HOST}:{self.port}"

    def close(self) -> None:
        """Close the server and every connection."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(3.0)

    async def _serve(
        self, opened: "Future[tuple[int, asyncio.AbstractEventLoop]]"
    ) -> None:
        """Serve on the first free port until `close`; reports port and event loop."""
        for port in range(self.port, self.port + TRIED_PORTS):
            # OverflowError: there is no such port
            with suppress(OSError, OverflowError):
                async with server.serve(
                    self._relay,
                    self._host,
                    port,
                    process_request=self._admit,
                    select_subprotocol=_viser_protocol,
                    **_BROWSER_OPTIONS,
                ) as bound:
                    bound_port = bound.sockets[0].getsockname()[1]
                    opened.set_result((bound_port, asyncio.get_running_loop()))
                    await self._closing.wait()
                    return
        last = self.port + TRIED_PORTS - 1
        opened.set_exception(
            OSError(
                f"no free port from {self.port} to {last}; choose a --port to 65535"
            )
        )

    async def _admit(
        self, connection: ServerConnection, request: Request
    ) -> Response | None:
        """Answer a request for the page or a stop; None accepts a websocket."""
        headers = request.headers
        path = request.path.partition("?")[0]
        if reason := self._objection(headers, path):
            self.refused[reason] += 1
            status = http.HTTPStatus(STATUS_CODES[reason])
            return connection.respond(status, f"{status.phrase}: {reason}\n")
        if _asks_for_websocket(headers):
            return None
        if path == STOP and self._on_stop is not None:
            text = await asyncio.to_thread(self._on_stop)
            status = http.HTTPStatus.OK if text else http.HTTPStatus.SERVICE_UNAVAILABLE
            return connection.respond(status, text or NO_RESPONSE)
        answer = Headers(_HEADERS)
        body = self._page
        if "gzip" in headers.get("Accept-Encoding", ""):
            answer["Content-Encoding"] = "gzip"
        else:
            body = gzip.decompress(body)
        answer["Content-Length"] = str(len(body))
        return Response(200, "OK", answer, body)

    def _objection(self, headers: Headers, path: str) -> str:
        """Reason to refuse a request, or nothing.

        A stop must come from our page: a page of another origin cannot send the header,
        since the gate does not allow it (no CORS).
        """
        if any(len(headers.get_all(name)) > 1 for name in UNIQUE_HEADERS):
            return "duplicate"
        host = headers.get("Host", "")
        if not LOCAL.fullmatch(host):
            return "host"  # DNS rebinding: another name that points to this machine
        if _asks_for_websocket(headers):
            if headers.get("Origin") != f"http://{host}":
                return "origin"
            return "full" if self._connections >= MAX_CONNECTIONS else ""
        if path == STOP and self._on_stop is not None:
            return "" if STOP_HEADER in headers else "origin"
        return "" if path in ("/", "/index.html") else "path"

    async def _relay(self, browser: ServerConnection) -> None:
        """Pass messages in both directions until either side closes."""
        self._connections += 1
        try:
            if browser.request is not None and browser.request.path == STEER:
                return await self._check_all(browser, self._steer)
            async with connect(
                f"ws://{HOST}:{self._viser_port}",
                origin=Origin(self._secret),
                subprotocols=[browser.subprotocol] if browser.subprotocol else None,
                **_VISER_OPTIONS,
            ) as viser:
                to_browser = asyncio.create_task(_relay_to_browser(viser, browser))
                await self._relay_to_viser(browser, viser)
                to_browser.cancel()
        except (OSError, InvalidHandshake):
            await browser.close(1011, "the page's server does not respond")
        finally:
            self._connections -= 1

    async def _relay_to_viser(
        self, browser: ServerConnection, viser: ClientConnection
    ) -> None:
        """Pass valid messages; disconnect a browser that floods or sends others."""

        async def accept(message: str | bytes) -> bool:
            if not is_valid(message):
                return False
            await viser.send(message)
            return True

        await self._check_all(browser, accept)

    async def _steer(self, message: str | bytes) -> bool:
        """Accept a message of a steering connection; return whether it is valid."""
        steering = steering_of(message)
        if steering is None or self._on_steer is None:
            return False
        self._on_steer(steering.key, steering.direction)
        return True

    async def _check_all(
        self, browser: ServerConnection, accept: Callable[[Any], Awaitable[bool]]
    ) -> None:
        """Accept valid messages; disconnect a browser that floods or sends others.

        Args:
            browser: that sends them.
            accept: handles a message; returns whether it is valid.
        """
        times = deque[float](maxlen=BURST)
        refused = 0
        with suppress(ConnectionClosed):
            async for message in browser:
                times.append(time.monotonic())
                duration = times[-1] - times[0]
                flood = len(times) == BURST and duration < WITHIN
                if not flood and await accept(message):
                    continue
                reason = "flood" if flood else "form"
                self.refused[reason] += 1
                refused += 1
                if flood or refused > MAX_REFUSED:
                    return await _disconnect(browser, CLOSE_REASONS[reason])


async def _disconnect(browser: ServerConnection, reason: str) -> None:
    """Close a connection even if the browser does not respond."""
    with suppress(TimeoutError):
        await asyncio.wait_for(browser.close(1008, reason), CLOSE_TIMEOUT)
    browser.transport.abort()


async def _relay_to_browser(viser: ClientConnection, browser: ServerConnection) -> None:
    """Pass messages of viser until it closes, then close the browser's connection."""
    with suppress(ConnectionClosed):
        async for message in viser:
            await browser.send(message)
    await browser.close()


def _page_of(port: int, added: bytes) -> bytes:
    """Viser's page with elements added at its end, compressed."""
    try:
        with urllib.request.urlopen(f"http://{HOST}:{port}/", timeout=10) as answer:
            before, end, after = answer.read().rpartition(b"</body>")
    except OSError as error:
        raise S2C2AError(f"viser does not respond on port {port}: {error}") from error
    return gzip.compress(before + added + end + after, 6)


def _asks_for_websocket(headers: Headers) -> bool:
    return headers.get("Upgrade", "").lower() == "websocket"


def _viser_protocol(connection: ServerConnection, offered) -> Subprotocol | None:
    """The subprotocol with which viser's page states its version."""
    for name in offered:
        if name.startswith("viser-v"):
            return Subprotocol(name)
    return None
