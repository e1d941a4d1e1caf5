"""Recorder of the live page: writes control steps to a run directory as they come."""

import json
import queue
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

import numpy as np

from s2c2a.arm import save_arm
from s2c2a.episodes import Episode, EpisodeWriter, load_episodes, save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError
from s2c2a.files import write_atomically
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.runtime.record import build_piece, with_aligned_states
from s2c2a.versions import versions
from s2c2a.viz import Trace, replay_page

PIECE = 1.0  # s; what a power failure loses at most
MAX_PIECES = 600  # a file, which then becomes one episode: it is read as a whole


class Recorder:
    """Records control steps between `start` and `stop`, for any time.

    A thread appends a piece to the file every second. A file of ten minutes is closed,
    its pieces become one episode, and the recording goes on in the next file. So memory
    does not grow, and a killed process leaves all but the last second.

    Run directories are named by the time, never by a client.
    """

    def __init__(self, control: Control, folder: Path):
        """Create a recorder that writes run directories into a folder."""
        self._control = control
        self._folder = folder
        self._lock = threading.Lock()
        self._writing: _Writing | None = None
        self._unsubscribe: Callable[[], None] = lambda: None

    @property
    def running(self) -> bool:
        """Whether it records."""
        return self._writing is not None

    @property
    def error(self) -> str:
        """Why nothing is written any more, such as a full disk; empty if all is well."""
        writing = self._writing
        return str(writing.error) if writing and writing.error else ""

    def start(self) -> None:
        """Record from the next step on.

        Raises:
            S2C2AError: the run directory cannot be written.
        """
        with self._lock:
            if self._writing is None:
                writing = _Writing(self._control, self._folder)
                self._unsubscribe = self._control.watch(writing.add)
                self._writing = writing

    def stop(self) -> Path | None:
        """Write the rest of the recording and its replay pages.

        Returns:
            The run directory, or None with fewer than two steps.

        Raises:
            S2C2AError: the recording could not be written to its end.
        """
        with self._lock:
            writing = self._writing
            if writing is None:
                return None
            self._unsubscribe()
            self._writing = None
        return writing.finish()


class _Writing:
    """One recording, written by a thread.

    Attributes:
        error: that ended it.
    """

    def __init__(self, control: Control, folder: Path):
        self._arm = control.arm
        self._directory = _new_directory(folder, control)
        self._files: list[Path] = []
        self._count = 0
        self._last_number = -1
        self.error: S2C2AError | None = None
        self._snapshots: queue.SimpleQueue[Snapshot | None] = queue.SimpleQueue()
        self._writer = self._next_file()
        self._thread = threading.Thread(
            target=self._write_all, name="recorder", daemon=True
        )
        self._thread.start()

    def add(self, snapshot: Snapshot) -> None:
        """Queue a snapshot for writing; it returns at once."""
        if self.error is None:
            self._snapshots.put(snapshot)

    def finish(self) -> Path | None:
        """Write the rest; see `Recorder.stop`."""
        self._snapshots.put(None)
        self._thread.join()
        if self.error is not None:
            raise S2C2AError(
                f"the recording in {self._directory} ended after {self._count} steps: "
                f"{self.error}"
            )
        if self._count >= 2:
            return self._directory
        for path in self._directory.iterdir():  # written by this object alone
            path.unlink()
        self._directory.rmdir()
        return None

    def _next_file(self) -> EpisodeWriter:
        number = len(self._files) + 1
        stem = self._arm.name if number == 1 else f"{self._arm.name}-{number}"
        path = self._directory / f"{stem}{ENDING}"
        self._files.append(path)
        return EpisodeWriter.create(path, self._arm, {"verb": "live"})

    def _write_all(self) -> None:
        try:
            self._write_pieces()
            self._close_file()
        except S2C2AError as error:
            self._writer.close()
            self.error = error

    def _write_pieces(self) -> None:
        ended = False
        while not ended:
            piece, ended = self._next_piece()
            if not piece:
                continue
            if self._writer.count >= MAX_PIECES:
                self._close_file()
                self._writer = self._next_file()
            steps = [snapshot.step for snapshot in piece]
            strategy = piece[-1].strategy
            self._writer.append(
                build_piece(
                    steps,
                    self._arm,
                    verb="live",
                    strategy=strategy,
                    versions=versions(),
                )
            )
            self._count += len(steps)

    def _next_piece(self) -> tuple[list[Snapshot], bool]:
        """The new steps of a second, and whether they are the last."""
        end = time.monotonic() + PIECE
        piece: list[Snapshot] = []
        while (left := end - time.monotonic()) > 0:
            try:
                snapshot = self._snapshots.get(timeout=left)
            except queue.Empty:
                break
            if snapshot is None:
                return piece, True
            # a page that starts to watch may get a step twice; numbers begin anew when
            # the arm is opened again
            if snapshot.step.number != self._last_number:
                self._last_number = snapshot.step.number
                piece.append(snapshot)
        return piece, False

    def _close_file(self) -> None:
        """Make one episode of the pieces of the file, and its replay page."""
        self._writer.close()
        path = self._files[-1]
        if not self._writer.count:
            return
        pieces, options = load_episodes(path)
        episode = joined(pieces)
        save_episodes([episode], path, options)
        # a replay page needs measured states
        if "states" in episode.sensors and len(episode.running):
            trace = Trace(episode, str(episode.options["strategy"]))
            page = path.with_suffix(".html")
            replay_page([trace], self._arm, f"live with {self._arm.name}", page)


def _new_directory(folder: Path, control: Control) -> Path:
    """A new run directory with options and arm."""
    arm = control.arm
    base = folder / f"{datetime.now():%Y%m%d-%H%M%S}-live-{arm.name}"
    directory = base
    number = 1
    while directory.exists():
        number += 1
        directory = base.with_name(f"{base.name}-{number}")
    options = {
        "options": {"verb": "live", "arm": arm.model_dump(mode="json")},
        "versions": versions(),
    }
    text = json.dumps(options, indent=1, default=str)
    write_atomically(f"{text}\n", directory / "options.json")
    save_arm(arm, directory / "arm.toml", overwrite=True)
    return directory


def joined(pieces: Sequence[Episode]) -> Episode:
    """One episode of pieces that follow each other.

    A quantity that a piece lacks is NaN there; obstacles that it lacks are unused.
    """
    names = dict.fromkeys(name for piece in pieces for name in piece.columns)
    columns = {name: _joined_column(pieces, name) for name in names}
    columns["time"] = _rising(pieces)
    options = dict(pieces[-1].options)
    for name in ("faults", "vibrations"):
        texts = [text for piece in pieces for text in piece.options.get(name, ())]
        if texts:
            options[name] = list(dict.fromkeys(texts))
    return with_aligned_states(Episode(pieces[0].arm, columns, options))


def _joined_column(pieces: Sequence[Episode], name: str) -> np.ndarray:
    shapes = [p.columns[name].shape[1:] for p in pieces if name in p.columns]
    axes = Counter(map(len, shapes)).most_common(1)[0][0]
    usual = [shape for shape in shapes if len(shape) == axes]
    shape = tuple(int(size) for size in np.max(usual, axis=0))
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
