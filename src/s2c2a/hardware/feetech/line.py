"""Serial line to Feetech servos: packets out, answers in, with a time limit.

Differs from the vendor's scservo_sdk, whose receiver spins on the processor, gives up
all later servos after an absent one, and passes on the errors of pyserial.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from serial import Serial

from s2c2a.hardware.bus import BusError, PortLostError
from s2c2a.hardware.feetech.packets import OVERHEAD, Answer, take_answers

PORT_FAILURES: tuple[type[Exception], ...] = (OSError,)
"""What pyserial raises where a port is gone; its own errors are operating system errors."""
with suppress(ImportError):  # Windows has no termios
    import termios

    PORT_FAILURES = (OSError, termios.error)
OPEN_FAILURES: tuple[type[Exception], ...] = (*PORT_FAILURES, ValueError)

REPLY_TIMEOUT = 0.02
"""Longest wait for answers beyond the time on the line [s]; USB adapters hold bytes
back for up to 16 ms."""
POLL_PERIOD = 0.002  # [s]; a read returns at once when a byte arrives
WRITE_TIMEOUT = 0.1  # [s]
BITS_PER_BYTE = 10  # with start and stop bits


class SerialLine:
    """An open serial port that no other process may open in this way."""

    def __init__(self, port: str, baud_rate: int):
        """Open a port.

        Args:
            port: such as /dev/ttyUSB0.
            baud_rate: [bit/s].

        Raises:
            BusError: the port does not exist, or another process has opened it.
        """
        self._name = port
        self._baud_rate = baud_rate
        self._closed = False
        try:
            self._port = Serial(
                port,
                baud_rate,
                timeout=POLL_PERIOD,
                write_timeout=WRITE_TIMEOUT,
                exclusive=True,
            )
        except OPEN_FAILURES as error:
            raise BusError(
                f"cannot open the port {port}: {error}; check its name, the access "
                "rights and the cable, and close other programs that use it"
            ) from error
        # many ports do not know this mode
        with suppress(OSError, ValueError, AttributeError, NotImplementedError):
            self._port.set_low_latency_mode(True)

    @property
    def baud_rate(self) -> int:
        """Speed of the port [bit/s]."""
        return self._baud_rate

    def set_baud_rate(self, baud_rate: int) -> None:
        """Change the speed of the port [bit/s].

        Raises:
            PortLostError: the port is gone.
        """
        with self._lost_port_reported():
            self._port.baudrate = baud_rate
        self._baud_rate = baud_rate

    def send(self, packet: bytes) -> None:
        """Send a packet without an answer.

        Raises:
            PortLostError: the port is gone.
        """
        with self._lost_port_reported():
            self._port.write(packet)

    def exchange(
        self, packet: bytes, ids: Sequence[int], size: int
    ) -> dict[int, Answer]:
        """Send a packet and return the valid answers by id.

        Servos answer in the order of their ids: the exchange ends with the answer of
        the last one. Any number of absent servos costs one `REPLY_TIMEOUT` at most.

        Args:
            packet: instruction.
            ids: of the servos that answer, in their order.
            size: of the data in each answer [bytes].

        Raises:
            PortLostError: the port is gone.
        """
        answers: dict[int, Answer] = {}
        buffer = bytearray()
        with self._lost_port_reported():
            self._discard_input()
            self._port.write(packet)
            deadline = self._deadline(len(packet), len(ids), size)
            while ids[-1] not in answers and time.perf_counter() < deadline:
                buffer += self._port.read(max(1, self._port.in_waiting))
                for answer in take_answers(buffer, set(ids), size):
                    answers[answer.id] = answer
        return answers

    def close(self) -> None:
        """Close the port; allowed more than once."""
        self._closed = True
        with suppress(*PORT_FAILURES):
            self._port.close()

    def _discard_input(self) -> None:
        """Drop late answers to earlier packets."""
        waiting = self._port.in_waiting
        if waiting:
            self._port.read(waiting)

    def _deadline(self, sent: int, servos: int, size: int) -> float:
        count = sent + servos * (size + OVERHEAD)
        on_line = count * BITS_PER_BYTE / self._baud_rate
        return time.perf_counter() + on_line + REPLY_TIMEOUT

    @contextmanager
    def _lost_port_reported(self) -> Iterator[None]:
        if self._closed:
            raise PortLostError(f"the port {self._name} is closed; open a new bus")
        try:
            yield
        except PORT_FAILURES as error:
            raise PortLostError(
                f"the port {self._name} is gone: {error}; check the cable and the "
                "supply, then open the arm again"
            ) from error
