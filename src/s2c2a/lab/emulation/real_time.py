"""Event loop of an emulated arm, in real time."""

import select
import socket
import time
from abc import ABC, abstractmethod

from s2c2a.lab.emulation.plant import Plant

_LATEST = 0.2  # s; physics that is later than this loses the time
_LONGEST_SLEEP = 0.1  # s


class RealTimeArm(ABC):
    """An arm whose physics follows the wall clock, and what serves its users.

    Attributes:
        plant: the arm and its motors.
        now: time since the start [s].
        late: time that the physics lost on a busy machine [s].
    """

    def __init__(self, plant: Plant, duration: float):
        """Begin at time zero.

        Args:
            plant: the arm and its motors.
            duration: time after which the emulator ends [s].
        """
        self.plant = plant
        self.now = 0.0
        self.late = 0.0
        self._duration = duration
        self._stopped = False

    def stop(self) -> None:
        """Let the loop end soon; for signal handlers and other threads."""
        self._stopped = True

    @property
    @abstractmethod
    def _files(self) -> list[int | socket.socket]:
        """Where requests arrive."""

    @abstractmethod
    def _next_time(self) -> float:
        """Time at which something but the physics is due [s]."""

    @abstractmethod
    def _serve_all(self) -> None:
        """Do what is due at `now`."""

    @abstractmethod
    def advance_chunk(self) -> None:
        """Advance the arm by one chunk of physics."""

    def _loop(self) -> None:
        """Serve until `stop` is called or the duration is over."""
        start = time.monotonic()
        while not self._stopped and self.now < self._duration:
            physics = self.late + self.plant.time + self.plant.chunk
            due = min(physics, self._next_time())
            timeout = due - (time.monotonic() - start)
            timeout = min(max(0.0, timeout), _LONGEST_SLEEP)
            select.select(self._files, [], [], timeout)
            self.now = time.monotonic() - start
            self._serve_all()

    def _advance(self) -> None:
        """Advance the physics by at most one chunk, towards the wall clock."""
        behind = self.now - self.late - self.plant.time
        if behind < self.plant.chunk or self._is_busy(behind):
            return
        if behind > _LATEST:
            self.late += behind - self.plant.chunk
        self.advance_chunk()

    def _is_busy(self, behind: float) -> bool:
        """Whether the physics, which is behind by a time [s], must wait."""
        return False
