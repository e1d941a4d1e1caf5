"""Serial line of a servo bus: one owner, no busy waiting, and a clear error if lost."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from s2c2a.errors import S2C2AError
from s2c2a.lab.hardware.bus import BusError, PortLostError

PORT_FAILURES: tuple[type[Exception], ...] = (OSError, TypeError, AttributeError)
"""Exceptions of pyserial for a lost port; the last two for a closed one."""
with suppress(ImportError):  # Windows has no termios
    import termios

    PORT_FAILURES = (*PORT_FAILURES, termios.error)
REFUSALS: tuple[type[Exception], ...] = (*PORT_FAILURES, ValueError)
"""Exceptions of pyserial for a port that refuses to open, or a baud rate."""

BITS_PER_BYTE = 10  # with start and stop bit
POLL_PERIOD = 0.002  # s; a read returns at once when a byte arrives
LONGEST_DRAIN = 0.1  # s
WRITE_TIMEOUT = 0.2  # s; enough for the longest packet at the lowest speed
LATENCY_TIMER = "/sys/bus/usb-serial/devices/{name}/latency_timer"
"""File on Linux: time for which an FTDI adapter collects bytes [ms]."""


class SerialLine:
    """An open serial port that no other process can open.

    Attributes:
        port: its name.
        latency: longest time that the adapter keeps bytes [s].
    """

    def __init__(self, port: str, baud_rate: int):
        """Open the port.

        Raises:
            BusError: there is no such port, it is in use, or it refuses the speed.
            S2C2AError: the extra `hardware` is not installed.
        """
        serial = import_serial()
        self.port = port
        self._timeout_error = serial.SerialTimeoutException
        try:
            self._serial = serial.Serial(
                port,
                baud_rate,
                timeout=POLL_PERIOD,
                write_timeout=WRITE_TIMEOUT,
                exclusive=True,
            )
        except REFUSALS as error:
            raise BusError(
                f"the serial port '{port}' cannot be opened: {_cause(error)}; check that the "
                "adapter is plugged in, that no other program uses it, and that you "
                "have the right to use it (on Linux, the group dialout). "
                "`s2c2a motors scan` lists the ports"
            ) from error
        # many ports do not know this mode
        with suppress(OSError, ValueError, AttributeError, NotImplementedError):
            self._serial.set_low_latency_mode(True)
        self.latency = latency_of(port)

    @property
    def baud_rate(self) -> int:
        """Speed of the port [bit/s]."""
        return self._serial.baudrate

    @baud_rate.setter
    def baud_rate(self, baud_rate: int) -> None:
        try:
            self._serial.baudrate = baud_rate
        except PORT_FAILURES as error:
            raise self._lost(error) from error
        except ValueError as error:
            raise BusError(
                f"{self.port} cannot run at {baud_rate} bit/s: {error}"
            ) from error

    def wire_time(self, count: int) -> float:
        """Return the time that a number of bytes takes on the line [s]."""
        return count * BITS_PER_BYTE / self.baud_rate

    def write(self, data: bytes) -> None:
        """Drop the bytes received so far, then send bytes.

        Bytes that the adapter does not take in time are lost, as on a noisy line: no
        servo answers them.

        Raises:
            PortLostError: the port is gone.
        """
        with self._port_errors():
            self._serial.reset_input_buffer()
            with suppress(self._timeout_error):
                self._serial.write(data)

    def read(self, deadline: float) -> bytes:
        """Return the bytes that have arrived; wait for the first one, without spinning.

        Args:
            deadline: on the clock of `time.perf_counter` [s].

        Returns:
            The bytes; empty if none have arrived at the deadline. A call after the
            deadline returns the bytes that arrived before it.

        Raises:
            PortLostError: the port is gone.
        """
        with self._port_errors():
            while True:
                # the timeout of the port stays: pyserial sets the port up again when
                # it changes
                data = self._serial.read(max(self._serial.in_waiting, 1))
                if data:
                    return data + self._serial.read(self._serial.in_waiting)
                if time.perf_counter() >= deadline:
                    return data

    def ask(self, packet: bytes, patience: float, quiet_time: float) -> bytes:
        """Send a packet, and return everything that comes back but its own echo.

        Args:
            packet: to send.
            patience: longest wait for the first byte [s].
            quiet_time: time without a byte after which nothing more is awaited [s].

        Raises:
            PortLostError: the port is gone.
        """
        self.write(packet)
        heard = self.read(time.perf_counter() + patience)
        # a line that is never quiet must not block the caller
        end = time.perf_counter() + LONGEST_DRAIN
        while heard and time.perf_counter() < end:
            more = self.read(time.perf_counter() + quiet_time)
            if not more:
                break
            heard += more
        return heard.removeprefix(packet)

    def drain(self, quiet_time: float) -> None:
        """Drop bytes until none has arrived for a time.

        A line that is never quiet is drained for `LONGEST_DRAIN`.

        Args:
            quiet_time: time without a byte [s].

        Raises:
            PortLostError: the port is gone.
        """
        end = time.perf_counter() + LONGEST_DRAIN
        while self.read(time.perf_counter() + quiet_time) and time.perf_counter() < end:
            continue

    def close(self) -> None:
        """Close the port; allowed more than once."""
        with suppress(*PORT_FAILURES):
            self._serial.close()

    @contextmanager
    def _port_errors(self) -> Iterator[None]:
        try:
            yield
        except PORT_FAILURES as error:
            raise self._lost(error) from error

    def _lost(self, error: Exception) -> PortLostError:
        if not self._serial.is_open:
            return PortLostError(f"the port {self.port} is closed; open a new bus")
        return PortLostError(
            f"the port {self.port} is gone ({error}); check the cable, plug it in "
            "again, look for another program that uses it, then open the arm again"
        )


def import_serial():
    """Return the module of pyserial.

    Raises:
        S2C2AError: the extra `hardware` is not installed.
    """
    try:
        import serial  # noqa: PLC0415  # only users of a real arm need it
    except ImportError as error:
        raise S2C2AError(
            "pyserial is missing; install it, in your clone of s2c2a, with: "
            'pip install ".[hardware]"'
        ) from error
    return serial


def list_ports() -> list[tuple[str, str, str]]:
    """Return name, device and adapter's serial number of this computer's ports.

    A serial number that is missing is empty.
    """
    import_serial()
    from serial.tools import list_ports as ports  # noqa: PLC0415

    return [
        (port.device, port.description or "", port.serial_number or "")
        for port in sorted(ports.comports())
    ]


def adapter_of(port: str) -> str:
    """Return the serial number of the adapter of a port; empty if it has none."""
    device = str(Path(port).resolve())
    numbers = {name: number for name, _, number in list_ports()}
    return numbers.get(device, "")


def latency_of(port: str) -> float:
    """Return the latency timer of an adapter [s]; zero if it has none."""
    try:
        name = Path(port).resolve().name
        text = Path(LATENCY_TIMER.format(name=name)).read_text(encoding="ascii")
        return float(text) / 1000.0
    except (OSError, ValueError):
        return 0.0


def _cause(error: Exception) -> str:
    """Why a port did not open; pyserial repeats port and cause in its own message."""
    number = getattr(error, "errno", None)
    return os.strerror(number) if isinstance(number, int) else str(error)
