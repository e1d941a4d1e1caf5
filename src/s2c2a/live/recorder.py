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
        self._writer: StepWriter | None = None
        self._unsubscribe: Callable[[], None] = lambda: None

    @property
    def running(self) -> bool:
        """Whether it records."""
        return self._writer is not None

    @property
    def error(self) -> str:
        """Why nothing is written any more, such as a full disk; empty if all is well."""
        writer = self._writer
        return str(writer.error) if writer and writer.error else ""

    def start(self) -> None:
        """Record from the next step on.

        Raises:
            S2C2AError: the run directory cannot be written.
        """
        with self._lock:
            if self._writer is not None:
                return
            path = self._new_path()
            writer = StepWriter(path, self._control.arm, "live", self._finish_file)

            def add(snapshot: Snapshot) -> None:
                writer.add(snapshot.step, strategy=snapshot.strategy)

            self._unsubscribe = self._control.watch(add)
            self._writer = writer

    def stop(self) -> Path | None:
        """Write the rest of the recording and its replay pages.

        Returns:
            The run directory, or None with fewer than two steps.

        Raises:
            S2C2AError: the recording could not be written to its end.
        """
        with self._lock:
            writer = self._writer
            if writer is None:
                return None
            self._unsubscribe()
            self._writer = None
        writer.close()
        directory = writer.files[0].parent
        if writer.error is not None:
            raise S2C2AError(
                f"the recording in {directory} ended after "
                f"{counted(writer.count, 'step')}: {writer.error}"
            )
        if writer.count >= 2:
            return directory
        for path in directory.iterdir():  # written by this object alone
            path.unlink()
        directory.rmdir()
        return None

    def _new_path(self) -> Path:
        """Path of the recording in a new run directory with options and arm."""
        arm = self._control.arm
        base = self.folder / f"{datetime.now():%Y%m%d-%H%M%S}-live-{arm.name}"
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
        return directory / f"{arm.name}{ENDING}"

    def _finish_file(self, path: Path) -> None:
        """Make one episode of the pieces of a file, and its replay page."""
        pieces, _ = load_episodes(path)
        episode = joined(pieces)
        save_episodes([episode], path, {"verb": "live"})
        # a replay page needs measured states
        if "states" in episode.sensors and len(episode.running):
            trace = Trace(episode, str(episode.options["strategy"]))
            page = path.with_suffix(".html")
            arm = self._control.arm
            replay_page([trace], arm, f"live with {arm.name}", page)
