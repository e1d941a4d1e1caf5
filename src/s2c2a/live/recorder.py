"""Recorder of the live page: writes control steps to a run directory as they come."""

import json
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from s2c2a.arm import save_arm
from s2c2a.episodes import load_episodes, save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.errors import S2C2AError, counted
from s2c2a.execution.versions import versions
from s2c2a.files.text import write_atomically
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.runtime.step_writer import StepWriter, joined
from s2c2a.viz import Trace, replay_page


class Recorder:
    """Records control steps between `start` and `stop`, for any time.

    A `StepWriter` appends a piece to the file every second. A file of ten minutes is
    closed, its pieces become one episode, and the recording goes on in the next file.

    Run directories are named by the time, never by a client.
    """

    def __init__(self, control: Control, folder: Path):
        """Create a recorder that writes run directories into a folder."""
        self._control = control
        self.folder = folder
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
                writing = _Writing(self._control, self.folder)
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
    """One recording in a run directory of its own."""

    def __init__(self, control: Control, folder: Path):
        self._arm = control.arm
        # a new run directory with options and arm
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
        self._directory = directory
        path = self._directory / f"{self._arm.name}{ENDING}"
        self._writer = StepWriter(path, self._arm, "live", self._finish_file)

    @property
    def error(self) -> S2C2AError | None:
        """Error that ended it."""
        return self._writer.error

    def add(self, snapshot: Snapshot) -> None:
        """Queue a snapshot for writing; it returns at once."""
        self._writer.add(snapshot.step, strategy=snapshot.strategy)

    def finish(self) -> Path | None:
        """Write the rest; see `Recorder.stop`."""
        self._writer.close()
        count = self._writer.count
        if self.error is not None:
            raise S2C2AError(
                f"the recording in {self._directory} ended after "
                f"{counted(count, 'step')}: {self.error}"
            )
        if count >= 2:
            return self._directory
        for path in self._directory.iterdir():  # written by this object alone
            path.unlink()
        self._directory.rmdir()
        return None

    def _finish_file(self, path: Path) -> None:
        """Make one episode of the pieces of a file, and its replay page."""
        pieces, _ = load_episodes(path)
        episode = joined(pieces)
        save_episodes([episode], path, {"verb": "live"})
        # a replay page needs measured states
        if "states" in episode.sensors and len(episode.running):
            trace = Trace(episode, str(episode.options["strategy"]))
            page = path.with_suffix(".html")
            replay_page([trace], self._arm, f"live with {self._arm.name}", page)
