"""Keeps what happens, and writes it to a run folder of its own."""

import json
import threading
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

import numpy as np

from s2c2a.arm import ArmSpec, save_arm
from s2c2a.files import save_whole
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.versions import versions
from s2c2a.viz import Trace, replay_page
from s2c2a.viz.trace_files import TRACES, save_traces

MOST_STEPS = 36_000  # an hour at 10 Hz


class Recorder:
    """Records the loop's snapshots between `start` and `stop`; folders are named by the time, never by a client."""

    def __init__(self, loop: Control, folder: Path):
        """A recorder that writes new folders into one folder."""
        self._loop, self._folder = loop, folder
        self._snapshots: list[Snapshot] = []
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
                self._snapshots = []
                self._end = self._loop.watch(self._keep)

    def stop(self) -> Path | None:
        """Write what was recorded: traces, arm, replay page. Returns the folder, None where there was too little.

        Raises:
            S2C2AError: the folder cannot be written.
        """
        with self._lock:
            if self._end is None:
                return None
            self._end()
            self._end, kept = None, self._snapshots
        if len(kept) < 2:
            return None
        folder = self._folder / f"{datetime.now():%Y%m%d-%H%M%S}-live-{self._loop.arm.name}"
        folder.mkdir(parents=True, exist_ok=True)
        _write(kept, self._loop.arm, folder)
        return folder

    def _keep(self, snapshot: Snapshot) -> None:
        if len(self._snapshots) < MOST_STEPS:
            self._snapshots.append(snapshot)


def _write(snapshots: list[Snapshot], arm: ArmSpec, folder: Path) -> None:
    trace = trace_of(snapshots, arm)
    options = {"options": {"verb": "live", "arm": arm.model_dump(mode="json")}, "versions": versions()}
    save_whole(json.dumps(options, indent=1, default=str) + "\n", folder / "options.json")
    save_arm(arm, folder / "arm.toml", overwrite=True)
    save_traces([trace], arm, folder / f"{arm.name}.{TRACES}")
    replay_page([trace], arm, f"live with {arm.name}", folder / f"{arm.name}.html")


def trace_of(snapshots: list[Snapshot], arm: ArmSpec) -> Trace:
    """What was seen and asked, one row a control step."""
    goals = [snapshot.goal for snapshot in snapshots]
    spheres = np.stack([np.column_stack([goal.obstacles, goal.thresholds]) for goal in goals])
    asked = np.stack([np.asarray(goal.position_weights) > 0 for goal in goals])[..., None]
    pointed = np.stack([np.asarray(goal.axis_weights) > 0 for goal in goals])[..., None]
    return Trace(
        snapshots[-1].strategy,
        arm.control_period * np.arange(len(snapshots)),
        np.stack([snapshot.states for snapshot in snapshots]),
        np.where(asked, np.stack([goal.positions for goal in goals]), np.nan),
        np.where(pointed, np.stack([goal.axes for goal in goals]), np.nan),
        spheres[:, spheres[..., 3].max(axis=0) > 0],
    )
