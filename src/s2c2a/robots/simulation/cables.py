"""What cables make of their motors' motion on its way to the module: play, capstan friction, creep.

The motors chase a held command, so their path within a control step is monotone, and for monotone paths play is a clip.
Creep can make the path turn; then play is followed from physics step to physics step.
"""

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec

CablePath = Float[np.ndarray, "times modules cables"]


class CableTransmission:
    """Hysteresis between motors and modules of one arm.

    Attributes:
        transmitted: displacement [m] or tension [N] at the modules, shape (modules, cables).
        crept: what the material has got used to [m], shape (modules, cables).
    """

    def __init__(self, arm: ArmSpec, start: np.ndarray):
        cables = [module.cable for module in arm.modules]
        column = np.newaxis
        self._tension_driven = arm.actuation == "tension"
        self._play = np.array([cable.play for cable in cables])[:, column]
        self._friction = np.array([cable.friction for cable in cables])[:, column]
        self._tube_angle = np.deg2rad([cable.friction_angle_deg for cable in cables])[:, column]
        self._stiffness = np.array([cable.stiffness for cable in cables])[:, column]
        self._creep = np.array([cable.creep for cable in cables])[:, column]
        self._creep_time = np.array([cable.creep_time for cable in cables])[:, column]
        self.transmitted, self.crept = start.copy(), np.zeros_like(start)

    def pass_on(self, path: CablePath, times: np.ndarray, tensions: np.ndarray, bend_angles: np.ndarray) -> CablePath:
        """What the modules feel while the motors go along `path`.

        Args:
            path: motor positions [m] or tensions [N] over one control step, shape (times, modules, cables), monotone.
            times: of the path [s], from the start of the step.
            tensions: in the cables at the start of the step [N], shape (modules, cables).
            bend_angles: of the modules at the start of the step [rad], shape (modules,).
        """
        if self._creep.any():
            path = path - self._creep_along(path, times)
        low, high = self._band(path, tensions, bend_angles)
        felt = self._follow(low, high) if self._creep.any() else np.clip(self.transmitted, low, high)
        self.transmitted = felt[-1]
        return felt

    def _creep_along(self, path: CablePath, times: np.ndarray) -> CablePath:
        """Let the material get used to the path, physics step by physics step; returns how far it has."""
        share = 1.0 - np.exp(-np.diff(times, prepend=0.0)[:, None, None] / self._creep_time)
        crept = np.empty_like(path)
        for step, position in enumerate(path):
            self.crept = self.crept + share[step] * (self._creep * position - self.crept)
            crept[step] = self.crept
        return crept

    def _follow(self, low: CablePath, high: CablePath) -> CablePath:
        """Stay within a band that moves up and down."""
        felt, last = np.empty_like(low), self.transmitted
        for step in range(len(low)):
            last = felt[step] = np.clip(last, low[step], high[step])
        return felt

    def _band(self, path: CablePath, tensions: np.ndarray, bend_angles: np.ndarray):
        """The band around the motors' motion in which the modules' side stays where it is."""
        wrap = self._friction * (self._tube_angle + _bend_below(bend_angles)[:, None])
        if self._tension_driven:
            return path * np.exp(-wrap), path * np.exp(wrap)
        width = self._play + tensions * np.expm1(wrap) / self._stiffness
        return path - width, path + width


def _bend_below(bend_angles: np.ndarray) -> np.ndarray:
    """Sum of the bends of all modules below each one [rad]: their tubes run through those."""
    return np.concatenate([[0.0], np.cumsum(bend_angles)[:-1]])
