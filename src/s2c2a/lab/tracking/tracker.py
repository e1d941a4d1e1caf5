"""Interface of every tracker: motion capture, tags in front of a camera, a simulation.

A new source implements `Tracker`: it keeps the newest frame, so that a control loop never
waits for it. `ReceivingTracker` has the thread that a source on a network or a bus needs.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Self

from s2c2a.lab.tracking.poses import Pose, TrackingError


class DropError(TrackingError):
    """A packet, a picture or a part of one is dropped.

    Attributes:
        reason: why.
    """

    def __init__(self, message: str, reason: Enum):
        super().__init__(message)
        self.reason = reason


@dataclass(frozen=True, eq=False)
class PoseFrame:
    """Poses of all bodies that a tracker saw at one time.

    Attributes:
        arrival_time: on this computer's clock `time.perf_counter` [s].
        source_time: on the clock of the source [s].
        number: of the frame, as the source counts.
        poses: `T_world_body` by name, in the world frame of the source; a body that is
            lost is absent.
    """

    arrival_time: float
    source_time: float
    number: int
    poses: Mapping[str, Pose]

    def is_same(self, other: "PoseFrame") -> bool:
        """Return whether both are one frame.

        Numbers alone may repeat after a restart of the source.
        """
        is_same_number = self.number == other.number
        return is_same_number and self.arrival_time == other.arrival_time


class Tracker(ABC):
    """A source of poses. A context manager: entering starts it, leaving closes it."""

    @abstractmethod
    def start(self) -> None:
        """Begin to receive; without effect if the tracker has started.

        Raises:
            TrackingError: the source cannot be reached.
        """

    @abstractmethod
    def latest(self) -> PoseFrame | None:
        """Return the newest frame without waiting; None before the first."""

    @property
    def problem(self) -> str:
        """Why no frames arrive, for users; empty if nothing is known."""
        return ""

    @abstractmethod
    def close(self) -> None:
        """Stop receiving; allowed more than once, and before `start`."""

    def __enter__(self) -> Self:
        try:
            self.start()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_) -> None:
        self.close()
