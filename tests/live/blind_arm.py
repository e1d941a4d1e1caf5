"""A user's robot without a simulation, whose only sensor is its cables."""

import time

from s2c2a.arm import ArmGeometry
from s2c2a.robots import Robot, checked_action
from s2c2a.spaces import Reading, Sensor


class BlindArm(Robot):
    """Reaches each command at once; no sensor measures its states."""

    def __init__(self, arm, port: str = "", baud: int = 0):
        self.arm = arm
        self.port = port
        self.baud = baud
        self.now = time.perf_counter
        self._geometry = ArmGeometry.of(arm)
        self._cables = self._geometry.action_neutral

    @property
    def sensors(self):
        """Cables only."""
        return {"cables": Sensor(self._cables.shape, "m")}

    def open(self) -> Reading:
        """Start at rest."""
        self._start = self.now()
        self._cables = self._geometry.action_neutral
        return self.read()

    def read(self) -> Reading:
        """The last command."""
        elapsed = self.now() - self._start
        return Reading(elapsed, {"cables": self._cables.copy()})

    def send(self, action):
        """Reach the command at once."""
        self._cables = checked_action(action, self._geometry)
        return self._cables

    def close(self) -> None:
        """Do nothing."""
