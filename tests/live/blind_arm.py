"""An arm of a user's that no simulation stands behind: it says its cables and nothing else."""

import time

from s2c2a.arm import ArmGeometry
from s2c2a.robots import Robot, checked_action
from s2c2a.spaces import Reading, Sensor


class BlindArm(Robot):
    """Goes where it is told at once; nobody watches it."""

    def __init__(self, arm, port: str = "", baud: int = 0):
        self.arm, self.port, self.baud = arm, port, baud
        self._geometry = ArmGeometry.of(arm)
        self._cables = self._geometry.action_neutral

    @property
    def sensors(self):
        """Cables alone."""
        return {"cables": Sensor(self._cables.shape, "m")}

    def open(self) -> Reading:
        """At rest."""
        self._begun, self._cables = time.perf_counter(), self._geometry.action_neutral
        return self.read()

    def read(self) -> Reading:
        """What was sent."""
        return Reading(
            time.perf_counter() - self._begun, {"cables": self._cables.copy()}
        )

    def send(self, action):
        """Done at once."""
        self._cables = checked_action(action, self._geometry)
        return self._cables

    def close(self) -> None:
        """Nothing to do."""
