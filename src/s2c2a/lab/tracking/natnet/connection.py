"""Connection to Motive: handshake, names of the bodies, silence, restarts.

Only state and times; `tracker` has the sockets.
"""

from collections import Counter
from collections.abc import Mapping

from s2c2a.lab.tracking.natnet.layouts import LAYOUTS, MessageLayout
from s2c2a.lab.tracking.natnet.messages import MessageKind, ServerInfo
from s2c2a.lab.tracking.receiving import FIRST_PAUSE, LONGEST_PAUSE

KEEP_ALIVE_PERIOD = 0.5
"""Between two messages that keep a unicast stream running [s]."""
SILENCE = 1.0
"""Time without frames after which Motive has stopped or restarts [s]."""


class Connection:
    """What is known of Motive, and which request is due.

    Motive is connected when its version and the names of its bodies are known. After a
    silence, both are requested again: ids may mean other bodies after a restart.

    Attributes:
        layout: of the stream; None until Motive tells its version.
        names: of bodies by id; None until Motive sends its definitions. A name that
            two bodies have is absent.
        problem: why there are no frames; empty while they arrive.
    """

    def __init__(self, address: str):
        """Begin without a connection.

        Args:
            address: of Motive, for messages.
        """
        self._address = address
        self.layout: MessageLayout | None = None
        self.names: Mapping[int, str] | None = None
        self.problem = self._no_answer()
        self._heard = 0.0
        self._requested = float("-inf")
        self._next = float("-inf")
        self._pause = FIRST_PAUSE
        self._outdated = False

    @property
    def is_connected(self) -> bool:
        """Whether frames can be read."""
        return self.layout is not None and self.names is not None

    def due_request(self, now: float) -> MessageKind | None:
        """Return the request that is due, once; None: none is.

        Args:
            now: time on any steady clock [s].
        """
        if self.layout is not None and now - self._heard > SILENCE:
            if self.is_connected and not self.problem:
                self.problem = self._no_answer()
            self.layout = None
            self.names = None
            self._restart_requests(now)
        if now < self._next:
            return None
        self._requested = now
        if self.is_connected and not self._outdated:
            self._next = now + KEEP_ALIVE_PERIOD
            return MessageKind.KEEP_ALIVE
        self._next = now + self._pause
        self._pause = min(2 * self._pause, LONGEST_PAUSE)
        if self.layout is None:
            return MessageKind.CONNECT
        return MessageKind.REQUEST_DEFINITIONS

    def _restart_requests(self, now: float) -> None:
        self._pause = FIRST_PAUSE
        self._next = now

    def _no_answer(self) -> str:
        return (
            f"Motive at {self._address} does not answer; start it, switch on streaming "
            "in its settings, and let its firewall pass UDP"
        )

    def take_server_info(self, info: ServerInfo, now: float) -> None:
        """Use the answer to a request to connect."""
        if self.layout is not None:
            return
        self.layout = LAYOUTS.get(info.version)
        if self.layout is None:
            allowed = ", ".join(map(str, LAYOUTS))
            self.problem = (
                f"Motive streams NatNet {info.version}, and s2c2a reads {allowed}; choose "
                "one of these versions in Motive's streaming settings, or install such "
                "a Motive"
            )
            return
        self.problem = (
            f"Motive at {self._address} answers, but sends no frames; switch on live "
            "mode and streaming of rigid bodies"
        )
        self._heard = now
        self._restart_requests(now)

    def take_definitions(self, names: Mapping[int, str], now: float) -> None:
        """Use the names of bodies by id."""
        counts = Counter(names.values())
        self.names = {id: name for id, name in names.items() if counts[name] == 1}
        self._outdated = False
        self._heard = now
        self._pause = FIRST_PAUSE
        self._next = now + KEEP_ALIVE_PERIOD

    def take_frame(self, now: float) -> None:
        """Note that a frame was accepted."""
        self._heard = now
        self.problem = ""

    def request_soon(self, now: float) -> None:
        """Shorten the pause: Motive sends, and is not connected yet."""
        self._pause = FIRST_PAUSE
        self._next = min(self._next, max(now, self._requested + FIRST_PAUSE))

    def request_definitions(self, now: float) -> None:
        """Ask for the names again: the bodies have changed."""
        if not self._outdated:
            self._outdated = True
            self._pause = FIRST_PAUSE
            self._next = max(now, self._requested + KEEP_ALIVE_PERIOD)
