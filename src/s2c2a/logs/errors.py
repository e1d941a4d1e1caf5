"""Errors and size limits of imported logs."""

from s2c2a.errors import S2C2AError

MAX_BYTES = 400_000_000  # of one log after decompression
MAX_ROWS = 2_000_000
MAX_COLUMNS = 4096


class LogError(S2C2AError):
    """A log or its map cannot be used."""
