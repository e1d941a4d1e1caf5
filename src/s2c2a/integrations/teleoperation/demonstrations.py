"""Demonstrations: motions of a teleoperated arm, each an episode of one file."""

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from s2c2a.episodes import EpisodeWriter
from s2c2a.errors import RecordingError
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.runtime import StepRecord, build_episode
from s2c2a.spaces import Stage
from s2c2a.versions import versions

VERB = "teleoperate"
LONGEST = 600.0  # s; a longer demonstration ends by itself, as it is kept in memory
SHORTEST = 2  # steps in motion


class Demonstrations:
    """A file of demonstrations, to which this object appends.

    Attributes:
        count: number of demonstrations in the file.
    """

    def __init__(
        self, path: str | os.PathLike, control: Control, options: dict[str, Any]
    ):
        """Open the file, or create it.

        Args:
            path: of the file.
            control: of the arm, whose steps are recorded.
            options: of the episodes.

        Raises:
            RecordingError: the file cannot be written, or holds something else.
        """
        self._path = Path(path)
        self._control = control
        self._options = options
        self._lock = threading.Lock()
        self._steps: list[StepRecord] = []
        self._limit = round(LONGEST * control.arm.control_rate)
        self._unsubscribe: Callable[[], None] | None = None
        if self._path.exists():
            self._writer = EpisodeWriter(self._path)
            self._check_file()
        else:
            self._writer = EpisodeWriter.create(path, control.arm, {"verb": VERB})

    def _check_file(self) -> None:
        """Check that an existing file holds demonstrations of this arm."""
        verb = self._writer.options.get("verb")
        name = self._writer.arm.name
        same = self._writer.arm == self._control.arm
        if verb == VERB and same:
            return
        self.close()
        content = f"demonstrations of another arm ('{name}')"
        if verb != VERB:
            content = "no demonstrations"
        raise RecordingError(f"{self._path} holds {content}; choose another --out")

    @property
    def count(self) -> int:
        """Number of demonstrations in the file."""
        return self._writer.count

    @property
    def running(self) -> bool:
        """Whether a demonstration is being recorded."""
        return self._unsubscribe is not None

    @property
    def full(self) -> bool:
        """Whether the demonstration is as long as one may be."""
        return len(self._steps) >= self._limit

    @property
    def seconds(self) -> float:
        """Length of the demonstration so far [s]."""
        return len(self._steps) * self._control.arm.control_period

    def start(self) -> None:
        """Record from the next step on."""
        self.discard()
        self._unsubscribe = self._control.watch(self._add)

    def discard(self) -> None:
        """End the demonstration without saving it."""
        self._end()

    def save(self) -> bool:
        """End the demonstration and append it to the file.

        Returns:
            Whether it was saved: the arm must have moved for at least two steps.

        Raises:
            RecordingError: it cannot be written, such as on a full disk.
        """
        strategy = self._control.latest.strategy if self._control.latest else ""
        steps = self._end()
        if len(steps) < SHORTEST:
            return False
        options = {"verb": VERB, "strategy": strategy, "versions": versions()}
        episode = build_episode(steps, self._control.arm, **options, **self._options)
        self._writer.append(episode)
        return True

    def close(self) -> None:
        """Save a demonstration that runs, and close the file; an empty one is removed."""
        try:
            self.save()
        finally:
            empty = self._writer.count == 0
            self._writer.close()
            if empty and self._writer.options.get("verb") == VERB:
                self._path.unlink(missing_ok=True)

    def _add(self, snapshot: Snapshot) -> None:
        """Keep a step of an arm that moves or holds."""
        if snapshot.stage not in (Stage.RUN, Stage.HOLD):
            return
        with self._lock:
            if not self.full:
                self._steps.append(snapshot.step)

    def _end(self) -> list[StepRecord]:
        """End the demonstration; return its steps."""
        if self._unsubscribe is not None:
            self._unsubscribe()
            self._unsubscribe = None
        with self._lock:
            steps, self._steps = self._steps, []
        return steps
