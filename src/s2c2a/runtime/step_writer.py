"""Control steps on disk while they are done: a killed process loses the last second.

One mechanism serves recordings of the live page and runs of real arms.
"""

import math
import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode, EpisodeWriter
from s2c2a.episodes.blocks import MAX_BYTES
from s2c2a.errors import RecordingError, S2C2AError
from s2c2a.execution.versions import versions
from s2c2a.runtime.border import named_errors
from s2c2a.runtime.record import StepRecord, build_piece, with_aligned_states

PIECE = 1.0  # s; what a power failure loses at most
MAX_PIECES = 600  # a file, which may then become one episode: it is read as a whole
PIECES = "pieces"
"""Option of a file whose episodes are pieces of one."""

_Queued = tuple[StepRecord, dict[str, Any]]


def leave(path: Path) -> None:
    """Leave a finished file as it is."""


def ignore(steps: Sequence[StepRecord]) -> None:
    """Ignore the steps of a piece."""


class StepWriter:
    """Thread that appends a piece to a file every second, for any time.

    A file of ten minutes is closed, and the next one begins. Memory does not grow.

    Attributes:
        files: that were begun.
        count: number of steps on disk.
        error: that ended the writing, such as a full disk.
    """

    def __init__(
        self,
        path: Path,
        arm: ArmSpec,
        verb: str,
        finish: Callable[[Path], None] = leave,
        watch: Callable[[Sequence[StepRecord]], None] = ignore,
    ):
        """Begin the first file; the next ones have a number behind its name.

        Args:
            path: of the first file; replaced.
            arm: that is controlled.
            verb: the command, an option of the episodes.
            finish: called on the thread with every file that is closed and not empty.
            watch: called on the thread with the steps of every piece.

        Raises:
            S2C2AError: the file cannot be written.
        """
        self._path = path
        self._arm = arm
        self._verb = verb
        self._finish = finish
        self._watch = watch
        self.files: list[Path] = []
        self.count = 0
        self.error: S2C2AError | None = None
        self._last_number = -1
        self._steps: queue.SimpleQueue[_Queued | None] = queue.SimpleQueue()
        self._writer = self._next_file()
        self._thread = threading.Thread(
            target=self._write_all, name="step writer", daemon=True
        )
        self._thread.start()

    def add(self, step: StepRecord, **options: Any) -> None:
        """Queue a step for writing; it returns at once.

        Args:
            step: the record.
            options: of the episode, as they are now.
        """
        if self.error is None:
            self._steps.put((step, options))

    def close(self) -> None:
        """Write the rest; allowed once."""
        self._steps.put(None)
        self._thread.join()

    def _next_file(self) -> EpisodeWriter:
        number = len(self.files) + 1
        stem = self._path.stem if number == 1 else f"{self._path.stem}-{number}"
        path = self._path.with_stem(stem)
        self.files.append(path)
        return EpisodeWriter.create(path, self._arm, {"verb": self._verb, PIECES: True})

    def _write_all(self) -> None:
        try:
            with named_errors(RecordingError, f"{self._path} is not continued"):
                ended = False
                while not ended:
                    piece, ended = self._next_piece()
                    if not piece:
                        continue
                    if self._writer.count >= MAX_PIECES:
                        self._close_file()
                        self._writer = self._next_file()
                    steps = [step for step, _ in piece]
                    options = piece[-1][1]
                    self._writer.append(
                        build_piece(
                            steps,
                            self._arm,
                            verb=self._verb,
                            versions=versions(),
                            **options,
                        )
                    )
                    self.count += len(steps)
                    self._watch(steps)
                self._close_file()
        except S2C2AError as error:
            self._writer.close()
            self.error = error

    def _next_piece(self) -> tuple[list[_Queued], bool]:
        """The new steps of a second, and whether they are the last."""
        end = time.monotonic() + PIECE
        piece: list[_Queued] = []
        while (left := end - time.monotonic()) > 0:
            try:
                queued = self._steps.get(timeout=left)
            except queue.Empty:
                break
            if queued is None:
                return piece, True
            # a page that starts to watch may get a step twice; numbers begin anew when
            # the arm is opened again
            if queued[0].number != self._last_number:
                self._last_number = queued[0].number
                piece.append(queued)
        return piece, False

    def _close_file(self) -> None:
        self._writer.close()
        if self._writer.count:
            self._finish(self.files[-1])


def joined(pieces: Sequence[Episode]) -> Episode:
    """One episode of pieces that follow each other.

    A quantity that a piece lacks is NaN there; obstacles that it lacks are unused.

    Raises:
        RecordingError: a column would be larger than a file of episodes.
    """
    names = dict.fromkeys(name for piece in pieces for name in piece.columns)
    columns = {name: _joined_column(pieces, name) for name in names}
    columns["time"] = _rising(pieces)
    options = dict(pieces[-1].options)
    faults = [text for piece in pieces for text in piece.options.get("faults", ())]
    if faults:
        options["faults"] = list(dict.fromkeys(faults))
    return with_aligned_states(Episode(pieces[0].arm, columns, options))


def _joined_column(pieces: Sequence[Episode], name: str) -> np.ndarray:
    shapes = [p.columns[name].shape[1:] for p in pieces if name in p.columns]
    axes = Counter(map(len, shapes)).most_common(1)[0][0]
    usual = [shape for shape in shapes if len(shape) == axes]
    shape = tuple(int(size) for size in np.max(usual, axis=0))
    values_in_all = math.prod((sum(map(len, pieces)), *shape))
    if 8 * values_in_all > MAX_BYTES:
        raise RecordingError(
            f"the pieces of '{name}' make more than {MAX_BYTES} bytes when they are "
            "joined; the file is damaged, or its pieces do not belong together"
        )
    blank = 0.0 if name == "obstacles" else np.nan
    parts = []
    for piece in pieces:
        values = piece.columns.get(name)
        if values is None or values.shape[1:] != shape:
            part = np.full((len(piece), *shape), blank)
            if values is not None and values.ndim == part.ndim:
                part[tuple(slice(size) for size in values.shape)] = values
            values = part
        parts.append(values)
    return np.concatenate(parts)


def _rising(pieces: Sequence[Episode]) -> np.ndarray:
    """Times of all pieces; a clock that began anew continues [s]."""
    parts: list[np.ndarray] = []
    last = -np.inf
    for piece in pieces:
        times = np.asarray(piece.columns["time"])
        if times[0] <= last:
            times = times - times[0] + np.nextafter(last, np.inf)
        parts.append(times)
        last = float(times[-1])
    return np.concatenate(parts)
