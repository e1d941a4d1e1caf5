"""Jumps of the frame of a tracker, in frames as they arrive."""

from collections import deque

import numpy as np

from s2c2a.measurements.frame_jumps import AROUND, USUAL, Shift, find_frame_jumps
from s2c2a.spaces import States


class FrameJumps:
    """Finds jumps of the frame in frames as they arrive, two frames after the first."""

    def __init__(self, length: float):
        """A detector without a history.

        Args:
            length: of the arm [m].
        """
        self._length = length
        self.reset()

    def reset(self) -> None:
        """Forget all frames."""
        self._rows: deque[tuple[States, float]] = deque(maxlen=USUAL + 2 * AROUND)

    def find(self, states: States, time: float) -> Shift | None:
        """Add a frame; return the jump two frames before [m], None if there is none.

        Args:
            states: end position [m] and end axis, base frame; NaN where missing.
            time: of the measurement, on any steady clock [s].
        """
        self._rows.append((states, time))
        history = np.stack([row for row, _ in self._rows])
        times = np.array([time for _, time in self._rows])
        jumps = find_frame_jumps(history, times, self._length)
        return jumps.get(len(history) - AROUND)
