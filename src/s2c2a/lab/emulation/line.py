"""Serial line on a pseudo-terminal, with the time that bytes take on the wire."""

import errno
import os
import re
import struct
from contextlib import suppress
from pathlib import Path

from s2c2a.errors import S2C2AError
from s2c2a.lab.emulation.instructions import Reply

try:
    import termios
    import tty
    from fcntl import ioctl
except ImportError as error:
    raise S2C2AError(
        "emulated servos need pseudo-terminals, which Windows does not have; run the "
        "command on Linux, on macOS, or in the Windows Subsystem for Linux"
    ) from error

BITS_PER_BYTE = 10  # start bit, eight data bits, stop bit
_READ_SIZE = 4096
_BAUD_RATES = {
    getattr(termios, name): int(name[1:])
    for name in dir(termios)
    if re.fullmatch(r"B\d+", name)
}
_UNSET_BAUD_RATES = (0, 38_400)  # of a new pseudo-terminal
_OTHER_SPEED = 0o010000  # BOTHER of Linux: a speed without a constant, as 4.5 Mbit/s
_GET_TERMIOS2 = 0x802C542A  # TCGETS2
_TERMIOS2_SIZE = 44  # bytes; the last four are the output speed


class Line:
    """Master side of a pseudo-terminal behind a symbolic link with a stable name.

    Attributes:
        link: the symbolic link.
        file: descriptor of the master; -1 while unplugged.
        default_baud_rate: [bit/s], where the user of the port sets none.
    """

    def __init__(self, link: Path, default_baud_rate: int):
        """Choose a name; `plug` opens the line.

        Args:
            link: the symbolic link.
            default_baud_rate: [bit/s], where the user of the port sets none.
        """
        self.link = link
        self.default_baud_rate = default_baud_rate
        self.file = -1
        self._slave = -1
        self._wire_free = 0.0
        self._pending: list[tuple[float, bytes]] = []

    @property
    def is_plugged(self) -> bool:
        """Whether the pseudo-terminal exists."""
        return self.file >= 0

    def plug(self) -> None:
        """Open a pseudo-terminal, and let the link point to it.

        Raises:
            S2C2AError: the link cannot be written, or is no link.
        """
        if self.link.exists() and not self.link.is_symlink():
            raise S2C2AError(
                f"{self.link} exists and is no symbolic link; give another --link"
            )
        self.file, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self.file, False)
        part = self.link.with_name(f".{self.link.name}.{os.getpid()}")
        try:
            self.link.parent.mkdir(parents=True, exist_ok=True)
            part.unlink(missing_ok=True)
            part.symlink_to(os.ttyname(self._slave))
            part.replace(self.link)
        except OSError as error:
            raise S2C2AError(
                f"cannot write the link {self.link}: {error}; give another --link"
            ) from error

    def unplug(self) -> None:
        """Close the pseudo-terminal and remove the link; allowed more than once."""
        if not self.is_plugged:
            return
        with suppress(OSError):
            self.link.unlink(missing_ok=True)
        os.close(self.file)
        os.close(self._slave)
        self.file = -1
        self._pending.clear()
        self._wire_free = 0.0

    def user_baud_rate(self) -> int | None:
        """Return the speed that the user of the port set [bit/s], None if unknown."""
        try:
            code = termios.tcgetattr(self.file)[5]
            if code == _OTHER_SPEED:
                # speed of a terminal that has no constant [bit/s]; Linux only
                data = ioctl(self.file, _GET_TERMIOS2, bytes(_TERMIOS2_SIZE))
                return struct.unpack_from("=I", data, _TERMIOS2_SIZE - 4)[0]
            speed = _BAUD_RATES.get(code, 0)
        except (termios.error, OSError):
            return None
        return None if speed in _UNSET_BAUD_RATES else speed

    def receive(self) -> bytes:
        """Return the bytes that arrived."""
        try:
            return os.read(self.file, _READ_SIZE)
        except BlockingIOError:
            return b""
        except OSError as error:
            # Linux reports a port that no process has open.
            if error.errno == errno.EIO:
                return b""
            raise

    def occupy(self, size: int, now: float) -> None:
        """Note that bytes to the servos take the wire from now on.

        Args:
            size: number of bytes.
            now: time [s].
        """
        self._wire_free = max(self._wire_free, now) + self._duration(size)

    def queue(self, answers: list[Reply]) -> None:
        """Put answers on the wire, one after the other."""
        for answer in answers:
            self._wire_free += answer.delay + self._duration(len(answer.data))
            if answer.data:
                self._pending.append((self._wire_free, answer.data))

    @property
    def next_time(self) -> float:
        """Time at which the next answer is complete [s]; infinite without one."""
        return self._pending[0][0] if self._pending else float("inf")

    def transmit(self, now: float) -> None:
        """Hand over the answers whose last bit is through."""
        while self._pending and self._pending[0][0] <= now:
            _, data = self._pending.pop(0)
            # A full buffer loses bytes, as that of a serial adapter does.
            with suppress(BlockingIOError):
                os.write(self.file, data)

    def _duration(self, size: int) -> float:
        baud_rate = self.user_baud_rate() or self.default_baud_rate
        return size * BITS_PER_BYTE / baud_rate
