"""True parameters of the simulated modules: nominal values plus model mismatch."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, Module
from s2c2a.arm.geometry import directions_at

PerAxis = Float[np.ndarray, "3"]


@dataclass(frozen=True)
class MismatchedModule:
    """True parameters of one module, in MuJoCo's terms.

    Attributes:
        nominal: the module as the arm file describes it.
        axes: axes of its hinges and of its torsion, one a row, shape (3, 3); bending
            about the second one goes in the stiff direction.
        stiffnesses: about these axes [N m2], shape (3,).
        mass: [kg].
        cables: positions of the cables, module frame [m], shape (cables, 2).
    """

    nominal: Module
    axes: Float[np.ndarray, "3 3"]
    stiffnesses: PerAxis
    mass: float
    cables: Float[np.ndarray, "cables 2"]

    @classmethod
    def of(cls, module: Module) -> "MismatchedModule":
        """Apply the mismatch of a module to its nominal parameters."""
        mismatch = module.mismatch
        ratio = np.sqrt(mismatch.stiffness_ratio)
        bending = module.bending_stiffness
        stiffnesses = np.array([bending / ratio, bending * ratio, module.gj])
        angles = np.deg2rad(np.add(module.cable_angles_deg, mismatch.angle_errors_deg))
        radii = module.cable_radius * (1.0 + np.asarray(mismatch.radius_errors))
        cosine, sine = directions_at(np.deg2rad(mismatch.stiff_direction_deg))
        axes = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return cls(
            nominal=module,
            axes=axes + 0.0,  # no negative zeros
            stiffnesses=(1.0 + mismatch.stiffness_error) * stiffnesses,
            mass=module.mass * (1.0 + mismatch.mass_error),
            cables=radii[..., None] * directions_at(angles),
        )

    def cable_levers(
        self, axes: Float[np.ndarray, "3 3"]
    ) -> Float[np.ndarray, "cables 3"]:
        """Return how much longer a cable gets per rotation about each axis [m/rad].

        This is the z component of axis x position.
        """
        x, y = self.cables.T
        return np.outer(y, axes[:, 0]) - np.outer(x, axes[:, 1])

    @property
    def rest_angles(self) -> PerAxis:
        """Rotation about each axis without any force [rad]."""
        mismatch = self.nominal.mismatch
        azimuth = np.deg2rad(mismatch.rest_azimuth_deg)
        # bending towards x rotates about y
        axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return self.axes @ (np.deg2rad(mismatch.rest_bend_deg) * axis)

    def cubic_stiffnesses(self, segments: int) -> PerAxis:
        """Return the cubic stiffness of a segment about each axis [N m/rad3]."""
        hardening = self.nominal.mismatch.hardening * np.array([1.0, 1.0, 0.0])
        full_angle = np.deg2rad(self.nominal.bend_limit_deg) / segments
        growth = hardening / full_angle**2  # 1/rad2
        return growth * self.stiffnesses * segments / self.nominal.length


def cable_routing(arm: ArmSpec, owner: int) -> dict[int, float]:
    """Return the modules that the cables of module `owner` act on.

    Returns:
        Module -> radius of the cables there, as a share of their radius in `owner`.
    """
    coupling = arm.modules[owner].mismatch.coupling
    if arm.coupled_cables:
        coupling = 1.0
    routing = {} if coupling is None else dict.fromkeys(range(owner), coupling)
    routing[owner] = 1.0
    return routing
