"""The gate in front of viser: who may come in, and what may be said.

viser checks no origin, so any page in the same browser could drive the arm through it. The gate listens on 127.0.0.1,
lets in only pages that it served itself, passes on only messages of known form, and not too many of them. viser stands
behind it on a port of its own and takes websockets from the gate alone: they carry a secret as their origin.

The gate serves the page, so it also puts the Stop there, which is viser's neither to hide nor to break.
"""

import asyncio
import gzip
import http
import logging
import re
import secrets
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import websockets.asyncio.client
import websockets.asyncio.server
from websockets import Headers
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.http11 import Request, Response
from websockets.typing import Origin, Subprotocol

from s2c2a.errors import S2C2AError
from s2c2a.live.messages import MOST_BYTES, is_sound

HOST = "127.0.0.1"
LOCAL = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.ASCII)
ONCE = ("Host", "Origin", "Upgrade", "Accept-Encoding", "Connection")
STOP, STOP_HEADER = "/stop", "S2C2A-Stop"
STOP_BUTTON = Path(__file__).with_name("stop_button.html")
MOST_CONNECTIONS = 16
RATE, BURST = 100.0, 200.0  # messages a second of one browser; dragging sends about 20, turning the view as many
MOST_REFUSED = 20  # messages of unknown form, then the connection is closed
PING_EVERY, PING_PATIENCE = 3.0, 5.0  # s; a browser that is gone without a word is noticed
CLOSE_PATIENCE = 0.3  # s
TRIED_PORTS = 50

_QUIET = logging.getLogger("s2c2a.gate")
_QUIET.setLevel(logging.CRITICAL)  # to websockets, answers to plain requests are failed handshakes
_SAFE_HEADERS = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}


@contextmanager
def only_with(secret: str) -> Iterator[None]:
    """Websocket servers that are started meanwhile take only connections whose origin is the secret."""
    serve = websockets.asyncio.server.serve
    websockets.asyncio.server.serve = partial(serve, origins=[Origin(secret)])  # type: ignore[misc, assignment]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]


def new_secret() -> str:
    """An origin that no page can have."""
    return f"gate://{secrets.token_hex(16)}"


class Allowance:
    """How much one browser may still say: it grows with time, up to a burst."""

    def __init__(self, now: Callable[[], float] = time.monotonic):
        """Full at first."""
        self._now, self._left, self._last = now, BURST, now()

    def take(self) -> bool:
        """Whether one more message is allowed."""
        now = self._now()
        self._left = min(BURST, self._left + RATE * (now - self._last))
        self._last = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Gate:
    """A door on 127.0.0.1 to a viser server, in a thread of its own.

    Attributes:
        port: where browsers come in.
        refused: connections and messages that did not pass, by reason.
    """

    def __init__(self, port: int, behind: int, secret: str, on_stop: Callable[[], bool] | None = None):
        """Open the door on `port`, or on the next free one after it, to viser on port `behind`.

        Args:
            port: where browsers come in.
            behind: viser's.
            secret: that viser wants to hear.
            on_stop: stops the arm when somebody who looks at the page says so, and says whether it was heard.

        Raises:
            S2C2AError: no port is free, or viser does not answer.
        """
        self.port, self.refused = port, dict.fromkeys(("twice", "origin", "host", "path", "full", "form", "flood"), 0)
        self._behind, self._secret, self._open, self._on_stop = behind, secret, 0, on_stop
        self._page = _page_of(behind, b"" if on_stop is None else STOP_BUTTON.read_bytes())
        self._ready, self._fault = threading.Event(), ""
        self._loop, self._closing = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="gate", daemon=True)
        self._thread.start()
        self._ready.wait(10.0)
        if self._fault or not self._ready.is_set():
            raise S2C2AError(f"no way in: {self._fault or 'the gate did not open within 10 s'}")

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self.port}"

    def close(self) -> None:
        """Close the door and every connection."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(3.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except OSError as error:
            self._fault = str(error)
        finally:
            self._ready.set()
            self._loop.close()

    async def _serve(self) -> None:
        async with await self._bound():
            self._ready.set()
            await self._closing.wait()

    async def _bound(self):
        """The server, on the first free port."""
        for port in range(self.port, self.port + TRIED_PORTS):
            with suppress(OSError):
                server = await websockets.asyncio.server.serve(
                    self._pass_on,
                    HOST,
                    port,
                    process_request=self._admit,
                    select_subprotocol=_viser_protocol,
                    max_size=MOST_BYTES,
                    max_queue=8,
                    compression=None,
                    ping_interval=PING_EVERY,
                    ping_timeout=PING_PATIENCE,
                    close_timeout=CLOSE_PATIENCE,
                    logger=_QUIET,
                )
                self.port = server.sockets[0].getsockname()[1]
                return server
        raise OSError(f"no free port from {self.port} to {self.port + TRIED_PORTS - 1}; choose another --port")

    def _admit(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for the page; let a websocket through only where it comes from that page."""
        if any(len(request.headers.get_all(name)) > 1 for name in ONCE):
            return self._refuse("twice", connection, http.HTTPStatus.BAD_REQUEST)
        host, path = request.headers.get("Host", ""), request.path.partition("?")[0]
        if not LOCAL.fullmatch(host):  # a page elsewhere that points its name here
            return self._refuse("host", connection, http.HTTPStatus.FORBIDDEN)
        if request.headers.get("Upgrade", "").lower() == "websocket":
            return self._admit_websocket(connection, request, f"http://{host}")
        if path == STOP and self._on_stop is not None:
            return self._stop(connection, request)
        if path not in ("/", "/index.html"):
            return self._refuse("path", connection, http.HTTPStatus.NOT_FOUND)
        return self._page_response(request)

    def _admit_websocket(self, connection: ServerConnection, request: Request, own: str) -> Response | None:
        if request.headers.get("Origin") != own:
            return self._refuse("origin", connection, http.HTTPStatus.FORBIDDEN)
        if self._open >= MOST_CONNECTIONS:
            return self._refuse("full", connection, http.HTTPStatus.SERVICE_UNAVAILABLE)
        return None

    def _stop(self, connection: ServerConnection, request: Request) -> Response:
        """Stop the arm for our own page: others would have to be allowed to say the header, and nobody allows them."""
        if STOP_HEADER not in request.headers or self._on_stop is None:
            return self._refuse("origin", connection, http.HTTPStatus.FORBIDDEN)
        heard = self._on_stop()
        return connection.respond(*((200, "stopped\n") if heard else (503, "nobody hears\n")))

    def _refuse(self, reason: str, connection: ServerConnection, status: http.HTTPStatus) -> Response:
        self.refused[reason] += 1
        return connection.respond(status, f"{status.phrase}: {reason}\n")

    def _page_response(self, request: Request) -> Response:
        headers = Headers(_SAFE_HEADERS | {"Content-Type": "text/html; charset=utf-8", "Connection": "close"})
        body = self._page
        if "gzip" in request.headers.get("Accept-Encoding", ""):
            headers["Content-Encoding"] = "gzip"
        else:
            body = gzip.decompress(body)
        headers["Content-Length"] = str(len(body))
        return Response(200, "OK", headers, body)

    async def _pass_on(self, browser: ServerConnection) -> None:
        """Both ways until either side ends."""
        self._open += 1
        protocols = [Subprotocol(browser.subprotocol)] if browser.subprotocol else None
        try:
            async with websockets.asyncio.client.connect(
                f"ws://{HOST}:{self._behind}",
                origin=Origin(self._secret),
                subprotocols=protocols,
                compression=None,
                max_size=None,
                max_queue=4,
                ping_interval=None,
                close_timeout=CLOSE_PATIENCE,
            ) as viser:
                ways = [
                    asyncio.ensure_future(way) for way in (self._inwards(browser, viser), _outwards(viser, browser))
                ]
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        except (OSError, InvalidHandshake):
            await browser.close(1011, "the arm's page is not there")
        finally:
            self._open -= 1

    async def _inwards(self, browser: ServerConnection, viser: ClientConnection) -> None:
        """Sound messages pass; a browser that floods or talks nonsense is shown out."""
        allowance, nonsense = Allowance(), 0
        with suppress(ConnectionClosed):
            async for message in browser:
                if not allowance.take():
                    self.refused["flood"] += 1
                    return await _show_out(browser, "too many messages")
                if is_sound(message):
                    await viser.send(message)
                    continue
                self.refused["form"] += 1
                nonsense += 1
                if nonsense > MOST_REFUSED:
                    return await _show_out(browser, "messages of unknown form")


async def _show_out(browser: ServerConnection, reason: str) -> None:
    """Close without waiting for one that does not listen."""
    with suppress(TimeoutError):
        await asyncio.wait_for(browser.close(1008, reason), CLOSE_PATIENCE)
    browser.transport.abort()


async def _outwards(viser: ClientConnection, browser: ServerConnection) -> None:
    with suppress(ConnectionClosed):
        async for message in viser:
            await browser.send(message)


def _page_of(port: int, more: bytes) -> bytes:
    """Viser's page, with more at its end, compressed."""
    try:
        with urllib.request.urlopen(f"http://{HOST}:{port}/", timeout=10) as answer:
            before, end, after = answer.read().rpartition(b"</body>")
    except OSError as error:
        raise S2C2AError(f"viser does not answer on port {port}: {error}") from error
    return gzip.compress(before + more + end + after, 6)


def _viser_protocol(connection: ServerConnection, offered) -> Subprotocol | None:
    """Viser's page says its version so."""
    return next((Subprotocol(name) for name in offered if name.startswith("viser-v")), None)
