"""Keeps what happens, and writes it to a run folder of its own."""

import json
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from s2c2a.arm import save_arm
from s2c2a.episodes import save_episodes
from s2c2a.episodes.file import ENDING
from s2c2a.files import save_whole
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.runtime import episode_of
from s2c2a.versions import versions
from s2c2a.viz import Trace, replay_page

MAX_STEPS = 36_000  # an hour at 10 Hz


class Recorder:
    """Records control steps between `start` and `stop`; folders are named by the time, never by a client."""

    def __init__(self, control: Control, folder: Path):
        """A recorder that writes new folders into one folder."""
        self._control = control
        self._folder = folder
        self._kept: list[Snapshot] = []
        self._end: Callable[[], None] | None = None
        self._lock = threading.Lock()

    @property
    def running(self) -> bool:
        """Whether it records."""
        return self._end is not None

    def start(self) -> None:
        """Begin with the next step."""
        with self._lock:
            if self._end is None:
                self._kept = []
                self._end = self._control.watch(self._keep)

    def stop(self) -> Path | None:
        """Write what was recorded: the episode, arm, replay page. Returns the folder, None where there was too little.

        Raises:
            S2C2AError: the folder cannot be written.
        """
        with self._lock:
            if self._end is None:
                return None
            self._end()
            self._end = None
            kept = self._kept
        if len(kept) < 2:
            return None
        arm = self._control.arm
        made_with = versions()
        folder = self._folder / f"{datetime.now():%Y%m%d-%H%M%S}-live-{arm.name}"
        options = {
            "options": {"verb": "live", "arm": arm.model_dump(mode="json")},
            "versions": made_with,
        }
        save_whole(
            json.dumps(options, indent=1, default=str) + "\n", folder / "options.json"
        )
        save_arm(arm, folder / "arm.toml", overwrite=True)
        steps = [one.step for one in kept]
        strategy = kept[-1].strategy
        episode = episode_of(
            steps, arm, verb="live", strategy=strategy, versions=made_with
        )
        save_episodes([episode], folder / f"{arm.name}{ENDING}")
        # else there is nothing to draw
        if "states" in episode.sensors and len(episode.running):
            replay_page(
                [Trace(episode, strategy)],
                arm,
                f"live with {arm.name}",
                folder / f"{arm.name}.html",
            )
        return folder

    def _keep(self, snapshot: Snapshot) -> None:
        if len(self._kept) < MAX_STEPS and (
            not self._kept or snapshot.step.number > self._kept[-1].step.number
        ):
            self._kept.append(snapshot)
