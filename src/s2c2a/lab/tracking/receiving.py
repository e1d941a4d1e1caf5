"""Trackers whose sources send by themselves: a thread receives, and keeps the newest frame.

A tracker gives only how the next packet comes, and how a packet becomes a frame.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from threading import Event, Thread
from typing import Any, ClassVar, Protocol

from s2c2a.lab.tracking.datagrams import DropReason, FrameOrder
from s2c2a.lab.tracking.hosts import resolve
from s2c2a.lab.tracking.poses import TrackingError
from s2c2a.lab.tracking.tracker import DropError, PoseFrame, Tracker

FIRST_PAUSE = 0.1
"""Before a source that was lost is opened again [s]; it doubles until a frame comes."""
LONGEST_PAUSE = 3.0
"""Between two attempts to open a source [s]."""
CLOSE_TIME = 3.0
"""Time that `close` waits [s]; a driver that hangs is left to its thread."""


@dataclass(frozen=True)
class TrackerCounts:
    """Numbers since a tracker started.

    Attributes:
        accepted: packets or pictures that became frames.
        dropped: by reason; every reason is present.
        restarts: of the source.
    """

    accepted: int
    dropped: Mapping[Any, int]
    restarts: int


class ReceivingTracker(Tracker):
    """Owns the thread, the newest frame, the counts, and the pauses of a lost source.

    A frame is immutable, and replacing it is one step: a reader sees the former frame
    or the new one. Whatever a source or a packet does, the thread goes on, because a
    dead one looks like a lost source.

    Attributes:
        drop_reasons: why packets are dropped; `FAILED` is among them.
    """

    drop_reasons: ClassVar[type[Enum]] = DropReason

    def __init__(self) -> None:
        """A tracker that does not receive yet."""
        self._thread: Thread | None = None
        self._stop = Event()
        self._reset()

    def _reset(self) -> None:
        """Forget what an earlier start has received."""
        self._latest: PoseFrame | None = None
        self._order = FrameOrder()
        self._accepted = 0
        self._restarts = 0
        self._dropped: dict[Any, int] = dict.fromkeys(self.drop_reasons, 0)
        self._fault = ""

    @abstractmethod
    def _open(self) -> None:
        """Open what must be there at the start, or raise `TrackingError`."""

    @abstractmethod
    def _packets(self, stop: Event) -> Iterator[tuple]:
        """Wait for packets until the event is set.

        Raises:
            TrackingError: the source is lost; after a pause the method is called again.
        """

    @abstractmethod
    def _handle(self, content: Any, source: Any, arrival: float) -> None:
        """Use a packet of `_packets`: `_keep` its frame, or raise `DropError`."""

    def _await_connection(self) -> None:
        """Wait at the start for a source that answers, or raise `TrackingError`."""

    def _release(self) -> None:
        """Close what `_open` has opened; called more than once."""

    @property
    def counts(self) -> TrackerCounts:
        """Numbers of accepted frames and of dropped packets."""
        return TrackerCounts(self._accepted, self._dropped.copy(), self._restarts)

    def start(self) -> None:
        if self._thread is not None:
            return
        self._stop = Event()
        self._reset()
        try:
            self._open()
            self._thread = Thread(
                target=self._run,
                args=(self._stop,),
                name=type(self).__name__,
                daemon=True,
            )
            self._thread.start()
            self._await_connection()
        except BaseException:
            self.close()
            raise

    def latest(self) -> PoseFrame | None:
        return self._latest

    def close(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join(CLOSE_TIME)
        self._thread = None
        self._release()

    def _run(self, stop: Event) -> None:
        pause = FIRST_PAUSE
        while not stop.is_set():
            accepted = self._accepted
            with self._survive(stop):
                for packet in self._packets(stop):
                    # a tracker that was started again has another event, and new counts
                    if not stop.is_set():
                        with self._survive(stop):
                            self._handle(*packet)
            if self._accepted > accepted:
                pause = FIRST_PAUSE
            stop.wait(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    @contextmanager
    def _survive(self, stop: Event) -> Iterator[None]:
        """Count and note a failure instead of ending the thread."""
        try:
            yield
        except Exception as error:
            if not stop.is_set():
                self._fault = str(error)
                if isinstance(error, DropError):
                    self._dropped[error.reason] += 1
                elif not isinstance(error, TrackingError):
                    failed = self.drop_reasons["FAILED"]
                    self._dropped[failed] += 1
                    self._fault = str(failed.value)

    def _is_restart(self, frame: PoseFrame, sender: object = None) -> bool:
        """Refuse a frame that is not newer than all before, unless the source restarted.

        Raises:
            DatagramError: the frame is late, a duplicate, or from a second sender.
        """
        restarts = self._order.restarts
        self._order.accept(frame, sender)
        self._restarts = self._order.restarts
        return self._restarts > restarts

    def _keep(self, frame: PoseFrame) -> None:
        """Make a frame the newest one."""
        self._latest = frame
        self._accepted += 1
        self._fault = ""


class Dialog(Protocol):
    """What is known of a program that answers requests.

    Attributes:
        problem: why there are no frames; empty while they arrive.
    """

    problem: str

    @property
    def is_connected(self) -> bool:
        """Whether frames can be read."""


class MocapTracker(ReceivingTracker):
    """A tracker of a motion capture program, which answers before it sends frames."""

    _dialog: Dialog

    def __init__(self, host: str, timeout: float):
        """A tracker that does not receive yet.

        Args:
            host: computer with the program.
            timeout: time that `start` waits for its answer [s].
        """
        self._host = host
        self._timeout = timeout
        super().__init__()

    def _reset(self) -> None:
        super()._reset()
        self._settled = Event()

    @property
    def problem(self) -> str:
        return self._dialog.problem

    def _open(self) -> None:
        self._server = resolve(self._host)

    def _await_connection(self) -> None:
        self._settled.wait(self._timeout)
        if not self._dialog.is_connected:
            raise TrackingError(self.problem)
