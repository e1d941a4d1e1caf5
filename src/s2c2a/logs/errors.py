"""What goes wrong with logs and maps, and how large they may be."""

from s2c2a.errors import S2C2AError

MAX_BYTES = 400_000_000
MAX_ROWS = 2_000_000
MAX_COLUMNS = 4096
"""Of a log: bytes when unpacked, rows, columns."""


class LogError(S2C2AError):
    """A log, or the map that says what it holds, cannot be used."""
