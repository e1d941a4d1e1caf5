"""Frozen bodies: a tracker that has lost a body repeats its last pose.

An arm at rest repeats its poses, too, if the source's digits hide the noise. So a pose is
frozen only if it stays equal to the last bit

- after the cables that move this end were commanded to another place, and had time to
  get there, and
- while the poses of other bodies change.
"""

from collections import deque

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmGeometry
from s2c2a.lab.tracking.states import ModuleEnds
from s2c2a.lab.tracking.tracker import PoseFrame
from s2c2a.measurements.repeats import RepeatDetector
from s2c2a.spaces import Actions

FROZEN_CHANGE = 0.1
"""Change of a cable's command that an end must answer, as a fraction of the module's
action range. The backlash of the twins is 0.015 to 0.043 of it."""
RESPONSE = 0.5
"""Time that an end has to answer [s], as readings of the cables have
(`measurements.following.MAX_LAG`)."""
FROZEN_FRAMES = 3
"""Frames in which other bodies change."""


class FrozenBodies:
    """Finds the module ends whose pose is only repeated."""

    def __init__(self, ends: ModuleEnds, geometry: ArmGeometry):
        """A detector of an arm at rest.

        Args:
            ends: names of the bodies.
            geometry: of the arm; gives the action ranges.
        """
        self._names = ends.ends
        self._bodies = ends.bodies
        self._rest = np.asarray(geometry.action_neutral)
        self._scale = np.abs(geometry.action_scale)[:, None]
        self.reset()

    def reset(self) -> None:
        """Forget all frames and commands, as after the robot was opened at rest."""
        modules = len(self._names)
        self._repeats = RepeatDetector()
        self._last: Actions = self._rest
        # commands that an end need not have answered yet, and their times
        self._recent: deque[tuple[float, Actions]] = deque()
        # of each end since its pose was new: time, command, changes of the modules'
        # commands, frames in which other bodies changed
        self._since = np.full(modules, -np.inf)
        self._references = np.stack([self._rest] * modules)
        self._changes = np.zeros((modules, modules))
        self._frames = np.zeros(modules, dtype=int)

    def sent(self, command: Actions, time: float) -> None:
        """Add a command that the robot sent.

        Args:
            command: displacements or tensions [m or N], shape (modules, cables).
            time: on the clock of the frames' arrival [s].
        """
        self._settle(time - RESPONSE)  # also while no frames come
        self._last = command.copy()
        self._recent.append((time, self._last))

    def find(self, frame: PoseFrame) -> Bool[np.ndarray, " modules"]:
        """Return which ends are frozen in a new frame."""
        self._settle(frame.arrival_time - RESPONSE)
        changed = {name for name in self._bodies if self._is_new(name, frame)}
        for module, name in enumerate(self._names):
            if name in changed or name not in frame.poses:
                # count from a frame in which the pose of an end is new, or missing
                self._since[module] = frame.arrival_time
                self._references[module] = self._last
                self._changes[module] = 0.0
                self._frames[module] = 0
            elif changed:
                self._frames[module] += 1
        # the cables of all modules up to an end move it
        moved = np.maximum.accumulate(self._changes, axis=1).diagonal()
        return (moved > FROZEN_CHANGE) & (self._frames >= FROZEN_FRAMES)

    def _is_new(self, name: str, frame: PoseFrame) -> bool:
        pose = frame.poses.get(name)
        if pose is None:
            return False
        values = np.concatenate([pose.position, pose.rotation])
        return not self._repeats.is_repeated(name, values)

    def _settle(self, time: float) -> None:
        """Compare the commands that were sent until a time with those of the ends."""
        while self._recent and self._recent[0][0] <= time:
            sent, command = self._recent.popleft()
            for module, reference in enumerate(self._references):
                if sent > self._since[module]:
                    change = self._change(command - reference)
                    self._changes[module] = np.maximum(self._changes[module], change)

    def _change(self, difference: Actions) -> Float[np.ndarray, " modules"]:
        """Size of a change of commands; pulling all cables of a module bends nothing."""
        bending = difference - difference.mean(axis=1, keepdims=True)
        return np.asarray((np.abs(bending) / self._scale).max(axis=1))
