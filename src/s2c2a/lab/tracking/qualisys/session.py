"""Session with QTM: version, names of the bodies, stream, silence.

Only state and times; `tracker` has the socket.
"""

from s2c2a.lab.tracking.qualisys.packets import StreamParameters, is_supported_axis

VERSION = "1.20"
PERIOD = 1.0
"""Between two requests without an answer; silence after which frames are requested
again [s]."""
LOST = 3.0
"""Silence after which the connection is lost [s]."""
_NEW_BODIES = frozenset((1, 3, 8, 11))
"""Events: connected, capture started, file started, settings changed."""
_VERSION = f"Version {VERSION}"
_PARAMETERS = "GetParameters 3D 6D"
_STREAM = "StreamFrames AllFrames 6D"


class QtmSession:
    """What is known of QTM, and which commands are due.

    When frames come again after a measurement has stopped, or after a silence, the
    parameters are requested again, because bodies may have another order.

    Attributes:
        parameters: of the stream; None until QTM sends them.
        is_outdated: whether bodies may have another order when frames come again.
        is_refused: whether QTM does not have the version.
        problem: why there are no frames; empty while they arrive.
    """

    def __init__(self, address: str):
        """Begin without a connection.

        Args:
            address: of QTM, for messages.
        """
        self._qtm = f"QTM at {address}"
        self.problem = self._no_answer()
        self.disconnect()

    def disconnect(self) -> None:
        """Forget what is known; `problem` stays."""
        self.parameters: StreamParameters | None = None
        self.is_outdated = False
        self.is_refused = False
        self._error = ""
        self._commands: list[str] = []
        self._has_version = False
        self._last_packet = 0.0
        self._last_frame = 0.0
        self._next = float("inf")

    def connect(self, now: float) -> None:
        """Note that a connection is open.

        Args:
            now: time on any steady clock [s].
        """
        self.disconnect()
        self._commands = [_VERSION]
        self._last_packet = now

    @property
    def is_connected(self) -> bool:
        """Whether frames can be read."""
        return self.parameters is not None

    def is_lost(self, now: float) -> bool:
        """Whether QTM has been silent for too long."""
        return now - self._last_packet > LOST

    def lose(self) -> None:
        """Note that the connection is closed."""
        self.problem = self._error or self._no_answer()
        self.disconnect()

    def due_commands(self, now: float) -> list[str]:
        """Return the commands that are due, once."""
        if now >= self._next:
            self._next = now + PERIOD
            self._commands += self._repeated(now)
        commands = self._commands
        self._commands = []
        return commands

    def _repeated(self, now: float) -> list[str]:
        if self.parameters is None:
            return [_PARAMETERS]
        if now - self._last_frame > PERIOD:
            self.problem = self.problem or self._no_frames()
            self.is_outdated = True
            # the answer also shows that the connection works
            return [_PARAMETERS, _STREAM]
        return []

    def take_command(self, text: str, now: float) -> None:
        """Use an answer to a command."""
        self._last_packet = now
        lower = text.lower()
        if lower.startswith("version set to"):
            self._has_version = True
            self._next = now
        elif lower.startswith("version not"):
            self._refuse()

    def take_error(self, text: str, now: float) -> None:
        """Use an error."""
        self._last_packet = now
        if not self._has_version and text.lower().startswith("version not"):
            self._refuse()
        elif self.parameters is None:
            self._error = f"{self._qtm} reports: {text:.100}"
            self.problem = self._error

    def _refuse(self) -> None:
        self.is_refused = True
        self._error = (
            f"{self._qtm} does not have version {VERSION} of the RT protocol; "
            "install a newer QTM"
        )
        self.problem = self._error

    def take_parameters(self, parameters: StreamParameters, now: float) -> None:
        """Use the names of the bodies, if there are any, and the axes."""
        self._last_packet = now
        if not parameters.names:
            self.problem = (
                f"{self._qtm} has no 6DOF bodies; define base and end-1 to end-M in "
                "its project options"
            )
        elif not is_supported_axis(parameters.up):
            self.problem = (
                f"{self._qtm} has the axis {parameters.up:.10} up; choose +Z or +Y in "
                "its calibration settings"
            )
        else:
            if self.parameters is None:
                self._commands.append(_STREAM)
                self._error = ""
                self.problem = self._no_frames()
            self.parameters = parameters
            return
        self.parameters = None

    def take_no_data(self, now: float) -> None:
        """Note that no measurement runs."""
        self._last_packet = now
        self._last_frame = now
        self.is_outdated = True
        self.problem = self._no_frames()

    def take_frame(self, now: float) -> None:
        """Note that a frame was accepted."""
        self._last_packet = now
        self._last_frame = now
        self.problem = ""

    def take_event(self, number: int, now: float) -> None:
        """Use an event: a measurement or a file may have other bodies."""
        self._last_packet = now
        self.is_outdated = self.is_outdated or number in _NEW_BODIES

    def request_parameters(self, now: float) -> None:
        """Ask for the names again: the bodies may have changed."""
        self.parameters = None
        self.is_outdated = False
        self._next = now

    def _no_answer(self) -> str:
        return (
            f"{self._qtm} does not answer; start it, switch on its real-time output, "
            "and let its firewall pass TCP"
        )

    def _no_frames(self) -> str:
        return f"{self._qtm} answers, but sends no frames; start a measurement"
