"""The gate in front of viser: who may come in, and what may be said.

viser checks no origin, so any page in the same browser could drive the arm through it.
The gate listens on 127.0.0.1, lets in only pages that it served itself, passes on only
messages of known form, and not too many of them. viser stands behind it on a port of
its own and takes websockets from the gate alone: they carry a secret as their origin.

The gate serves the page, so it also puts the Stop there, which is viser's neither to
hide nor to break.
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
from collections.abc import Callable
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
from s2c2a.live.messages import MAX_BYTES, is_sound

HOST = "127.0.0.1"
LOCAL = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.ASCII)
ONCE = ("Host", "Origin", "Upgrade", "Accept-Encoding", "Connection")
STOP = "/stop"
STOP_HEADER = "S2C2A-Stop"
STOP_BUTTON = Path(__file__).with_name("stop_button.html")
MAX_CONNECTIONS = 16
# so many messages of one browser in so many s; dragging sends 20 in one, as turning
# does
BURST = 200
WITHIN = 2.0
MAX_REFUSED = 20  # messages of unknown form, then the connection is closed
CLOSE_PATIENCE = 0.3  # s
TRIED_PORTS = 50
REFUSALS = {"twice": 400, "host": 403, "origin": 403, "full": 503, "path": 404}
SHOWN_OUT = {"flood": "too many messages", "form": "messages of unknown form"}

_QUIET = logging.getLogger("s2c2a.gate")
# to websockets, answers to plain requests are failed handshakes
_QUIET.setLevel(logging.CRITICAL)
_BOTH_WAYS: dict[str, Any] = {"compression": None, "close_timeout": CLOSE_PATIENCE}
_TO_BROWSERS: dict[str, Any] = {
    "max_size": MAX_BYTES,
    "max_queue": 8,
    "logger": _QUIET,
} | _BOTH_WAYS
# s; a browser that is gone without a word is noticed
_TO_BROWSERS |= {"ping_interval": 3.0, "ping_timeout": 5.0}
_TO_VISER: dict[str, Any] = {
    "max_size": None,
    "max_queue": 4,
    "ping_interval": None,
} | _BOTH_WAYS
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
    """Websocket servers that are started meanwhile take only connections whose origin is the secret."""
    return patch.object(
        server, "serve", partial(server.serve, origins=[Origin(secret)])
    )


class Gate:
    """A door on 127.0.0.1 to a viser server, in a thread of its own.

    Attributes:
        port: where browsers come in.
        address: what to open in a browser.
        refused: connections and messages that did not pass, by reason.
    """

    def __init__(
        self,
        port: int,
        behind: int,
        secret: str,
        on_stop: Callable[[], bool] | None = None,
    ):
        """Open the door on `port`, or on the next free one after it, to viser on port `behind`.

        Args:
            port: where browsers come in.
            behind: viser's.
            secret: that viser wants to hear.
            on_stop: stops the arm when somebody who looks at the page says so, and says
                whether it was heard.

        Raises:
            S2C2AError: no port is free, or viser does not answer.
        """
        self.port = port
        self.refused = Counter[str]()
        self._behind = behind
        self._secret = secret
        self._open = 0
        self._on_stop = on_stop
        self._page = _page_of(
            behind, b"" if on_stop is None else STOP_BUTTON.read_bytes()
        )
        self._closing = asyncio.Event()
        opened = Future[tuple[int, asyncio.AbstractEventLoop]]()
        self._thread = threading.Thread(
            target=asyncio.run, args=(self._serve(opened),), name="gate", daemon=True
        )
        self._thread.start()
        try:
            self.port, self._loop = opened.result(10.0)
        except OSError as error:  # a timeout is one, without words
            raise S2C2AError(
                f"no way in: {str(error) or 'the gate did not open within 10 s'}"
            ) from error
        self.address = f"http://{HOST}:{self.port}"

    def close(self) -> None:
        """Close the door and every connection."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(3.0)

    async def _serve(
        self, opened: "Future[tuple[int, asyncio.AbstractEventLoop]]"
    ) -> None:
        """Serve on the first free port until the door closes; told on which one, and in which loop."""
        asked: dict[str, Any] = {
            "process_request": self._admit,
            "select_subprotocol": _viser_protocol,
        }
        for port in range(self.port, self.port + TRIED_PORTS):
            with suppress(OSError):
                async with server.serve(
                    self._pass_on, HOST, port, **asked, **_TO_BROWSERS
                ) as bound:
                    opened.set_result(
                        (bound.sockets[0].getsockname()[1], asyncio.get_running_loop())
                    )
                    await self._closing.wait()
                    return
        last = self.port + TRIED_PORTS - 1
        opened.set_exception(
            OSError(f"no free port from {self.port} to {last}; choose another --port")
        )

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for the page; let a websocket through only where it comes from that page."""
        headers = request.headers
        path = request.path.partition("?")[0]
        if reason := self._objection(headers, path):
            self.refused[reason] += 1
            status = http.HTTPStatus(REFUSALS[reason])
            return connection.respond(status, f"{status.phrase}: {reason}\n")
        if _asks_for_websocket(headers):
            return None
        if path == STOP and self._on_stop is not None:
            return connection.respond(
                *((200, "stopped\n") if self._on_stop() else (503, "nobody hears\n"))
            )
        packed = "gzip" in headers.get("Accept-Encoding", "")
        body = self._page if packed else gzip.decompress(self._page)
        more = {"Content-Length": str(len(body))} | (
            {"Content-Encoding": "gzip"} if packed else {}
        )
        return Response(200, "OK", Headers(_HEADERS | more), body)

    def _objection(self, headers: Headers, path: str) -> str:
        """Why a request is refused, or nothing.

        A stop is for our own page: others would have to be allowed to say the header,
        and nobody allows them.
        """
        if any(len(headers.get_all(name)) > 1 for name in ONCE):
            return "twice"
        host = headers.get("Host", "")
        stops = path == STOP and self._on_stop is not None
        websocket = _asks_for_websocket(headers)
        true = {
            # a page elsewhere that points its name here
            "host": not LOCAL.fullmatch(host),
            "origin": headers.get("Origin") != f"http://{host}"
            if websocket
            else stops and STOP_HEADER not in headers,
            "full": websocket and self._open >= MAX_CONNECTIONS,
            "path": not (websocket or stops or path in ("/", "/index.html")),
        }
        return next((reason for reason in true if true[reason]), "")

    async def _pass_on(self, browser: ServerConnection) -> None:
        """Both ways until either side ends."""
        self._open += 1
        said = [browser.subprotocol] if browser.subprotocol else None
        form: dict[str, Any] = {
            "origin": Origin(self._secret),
            "subprotocols": said,
        } | _TO_VISER
        try:
            async with connect(f"ws://{HOST}:{self._behind}", **form) as viser:
                outwards = asyncio.create_task(_outwards(viser, browser))
                await self._inwards(browser, viser)
                outwards.cancel()
        except (OSError, InvalidHandshake):
            await browser.close(1011, "the arm's page is not there")
        finally:
            self._open -= 1

    async def _inwards(
        self, browser: ServerConnection, viser: ClientConnection
    ) -> None:
        """Sound messages pass; a browser that floods or talks nonsense is shown out."""
        came = deque[float](maxlen=BURST)
        nonsense = 0
        with suppress(ConnectionClosed):
            async for message in browser:
                came.append(time.monotonic())
                flood = len(came) == BURST and came[-1] - came[0] < WITHIN
                if not flood and is_sound(message):
                    await viser.send(message)
                    continue
                fault = "flood" if flood else "form"
                self.refused[fault] += 1
                nonsense += 1
                if flood or nonsense > MAX_REFUSED:
                    return await _show_out(browser, SHOWN_OUT[fault])


async def _show_out(browser: ServerConnection, reason: str) -> None:
    """Close without waiting for one that does not listen."""
    with suppress(TimeoutError):
        await asyncio.wait_for(browser.close(1008, reason), CLOSE_PATIENCE)
    browser.transport.abort()


async def _outwards(viser: ClientConnection, browser: ServerConnection) -> None:
    """What viser says; when it ends, so does the browser's connection."""
    with suppress(ConnectionClosed):
        async for message in viser:
            await browser.send(message)
    await browser.close()


def _page_of(port: int, more: bytes) -> bytes:
    """Viser's page, with more at its end, compressed."""
    try:
        with urllib.request.urlopen(f"http://{HOST}:{port}/", timeout=10) as answer:
            before, end, after = answer.read().rpartition(b"</body>")
    except OSError as error:
        raise S2C2AError(f"viser does not answer on port {port}: {error}") from error
    return gzip.compress(before + more + end + after, 6)


def _asks_for_websocket(headers: Headers) -> bool:
    return headers.get("Upgrade", "").lower() == "websocket"


def _viser_protocol(connection: ServerConnection, offered) -> Subprotocol | None:
    """Viser's page says its version so."""
    return next(
        (Subprotocol(name) for name in offered if name.startswith("viser-v")), None
    )
