"""Exposure times of frames on this computer's clock."""

import math

WINDOW = 10.0  # s; half of the time over which the fastest frame is sought
RESTART = 1.0  # s; a source clock that steps back by more begins again


class ExposureClock:
    """Estimates when the poses of a frame were true.

    The clock of the source and that of this computer differ by an offset, which is the
    smallest difference between arrival and source time in some seconds: no frame can
    arrive before it was sent. A frame that took longer than the fastest ones is
    older by that much. The window lets the offset follow clocks that drift apart: by
    50 parts in a million they differ by a millisecond after its 20 s. A clock that
    steps back has begun again, and its offset is unknown.

    Args:
        latency: from exposure to arrival of the fastest frames [s].
    """

    def __init__(self, latency: float = 0.0):
        self._latency = latency
        self._last_time = -math.inf
        self._forget_offset()

    def _forget_offset(self) -> None:
        self._offset = math.inf
        self._next_offset = math.inf
        self._window_end = -math.inf

    def exposure(self, arrival: float, source_time: float) -> float:
        """Return the exposure time of a frame on this computer's clock [s].

        Args:
            arrival: of the frame on this computer's clock [s].
            source_time: of the frame on the clock of its source [s].
        """
        if self._last_time - source_time > RESTART:
            self._forget_offset()
        self._last_time = source_time
        offset = arrival - source_time
        if arrival > self._window_end:
            self._offset = self._next_offset
            self._next_offset = math.inf
            self._window_end = arrival + WINDOW
        self._next_offset = min(self._next_offset, offset)
        self._offset = min(self._offset, self._next_offset)
        return source_time + self._offset - self._latency
