"""Recorder of the live page: writes control steps to a run directory."""

import json
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from s2c2a.arm import save_arm
from s2c2a.episodes import save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.files import write_atomically
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.runtime import build_episode
from s2c2a.versions import versions
from s2c2a.viz import Trace, replay_page

MAX_STEPS = 36_000  # an hour at 10 Hz


class Recorder:
    """Records control steps between `start` and `stop`.

    Run directories are named by the time, never by a client.
    """

    def __init__(self, control: Control, folder: Path):
        """Create a recorder that writes run directories into a folder."""
        self._control = control
        self._folder = folder
        self._snapshots: list[Snapshot] = []
        self._unsubscribe: Callable[[], None] | None = None
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether it records."""
        return self._unsubscribe is not None

    def start(self) -> None:
        """Record from the next step on."""
        with self._lock:
            if self._unsubscribe is None:
                self._snapshots = []
                self._unsubscribe = self._control.watch(self._append)

    def stop(self) -> Path | None:
        """Write the recorded episode, the arm and a replay page.

        Returns:
            The run directory, or None with fewer than two steps.

        Raises:
            S2C2AError: the run directory cannot be written.
        """
        with self._lock:
            if self._unsubscribe is None:
                return None
            self._unsubscribe()
            self._unsubscribe = None
            snapshots = self._snapshots
        if len(snapshots) < 2:
            return None
        arm = self._control.arm
        package_versions = versions()
        folder = self._folder / f"{datetime.now():%Y%m%d-%H%M%S}-live-{arm.name}"
        options = {
            "options": {"verb": "live", "arm": arm.model_dump(mode="json")},
            "versions": package_versions,
        }
        text = json.dumps(options, indent=1, default=str)
        write_atomically(f"{text}\n", folder / "options.json")
        save_arm(arm, folder / "arm.toml", overwrite=True)
        steps = [snapshot.step for snapshot in snapshots]
        strategy = snapshots[-1].strategy
        episode = build_episode(
            steps, arm, verb="live", strategy=strategy, versions=package_versions
        )
        save_episodes([episode], folder / f"{arm.name}{ENDING}")
        # a replay page needs measured states
        if "states" in episode.sensors and len(episode.running):
            trace = Trace(episode, strategy)
            page = folder / f"{arm.name}.html"
            replay_page([trace], arm, f"live with {arm.name}", page)
        return folder

    def _append(self, snapshot: Snapshot) -> None:
        snapshots = self._snapshots
        if len(snapshots) >= MAX_STEPS:
            return
        if not snapshots or snapshot.step.number > snapshots[-1].step.number:
            snapshots.append(snapshot)
