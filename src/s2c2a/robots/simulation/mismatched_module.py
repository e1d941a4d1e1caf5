"""Modules as the simulated arm really has them: what an arm file says, and its mismatch on top."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, Module


@dataclass(frozen=True)
class MismatchedModule:
    """One module, in the numbers that MuJoCo is given.

    Attributes:
        described: what the arm file says of it.
        axes: of its hinges and its twist, one a row; bending about the second goes in
            the stiff direction, (3, 3).
        stiffnesses: about these axes [N m2].
        mass: [kg].
        cables: where they are, module frame [m], shape (cables, 2).
    """

    described: Module
    axes: Float[np.ndarray, "3 3"]
    stiffnesses: Float[np.ndarray, "3"]
    mass: float
    cables: Float[np.ndarray, "cables 2"]

    @classmethod
    def of(cls, module: Module) -> "MismatchedModule":
        """As its description and its mismatch say."""
        mismatch = module.mismatch
        ratio = np.sqrt(module.mismatch.stiffness_ratio)
        stiffer = 1.0 + mismatch.stiffness_error
        bending = module.bending_stiffness
        angles = np.deg2rad(np.add(module.cable_angles_deg, mismatch.angle_errors_deg))
        radii = np.broadcast_to(
            module.cable_radius * (1.0 + np.asarray(mismatch.radius_errors)),
            angles.shape,
        )
        return cls(
            described=module,
            axes=_turned(np.deg2rad(mismatch.stiff_direction_deg)),
            stiffnesses=stiffer
            * np.array([bending / ratio, bending * ratio, module.gj]),
            mass=module.mass * (1.0 + mismatch.mass_error),
            cables=np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1),
        )

    def levers_about(
        self, axes: Float[np.ndarray, "3 3"]
    ) -> Float[np.ndarray, "cables 3"]:
        """How much longer a cable gets with a turn about each of some axes [m]: the z of axis x place."""
        x, y = self.cables.T
        return np.outer(y, axes[:, 0]) - np.outer(x, axes[:, 1])

    @property
    def rest_turns(self) -> Float[np.ndarray, "3"]:
        """Turn about each axis without any force [rad]."""
        x, y = self.described.mismatch.rest_bend
        return self.axes @ np.array([-y, x, 0.0])  # bending towards x turns about y

    def cubic(self, segments: int) -> Float[np.ndarray, "3"]:
        """What a segment's stiffness about each axis grows by, over the square of its turn [N m/rad3]."""
        mismatch = self.described.mismatch
        full = np.deg2rad(self.described.bend_limit_deg) / segments
        grows = mismatch.hardening * np.array([1.0, 1.0, 0.0]) / full**2
        return grows * self.stiffnesses * segments / self.described.length


def passed_shares(arm: ArmSpec, owner: int) -> dict[int, float]:
    """Modules that the cables of one run through, and there at which part of their radius."""
    coupling = 1.0 if arm.coupled_cables else arm.modules[owner].mismatch.coupling
    return ({} if coupling is None else dict.fromkeys(range(owner), coupling)) | {
        owner: 1.0
    }


def _turned(angle: float) -> Float[np.ndarray, "3 3"]:
    """The axes x, y, z turned about z."""
    cosine = np.cos(angle)
    sine = np.sin(angle)
    # no negative zeros
    return np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]) + 0.0
