"""Constants of a forward model from the arm file: lengths, cables, masses."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.kinematics import bends_from_cables, bends_from_configurations
from s2c2a.models.arrays import Actions, Bends, Configurations, Matrices, PerModule
from s2c2a.training.fit import FromArm

TAUT = 0.5  # typical share of cables that are taut


class Trunk(FromArm):
    """Geometry, compliances and masses of an arm.

    Attributes:
        lengths: of modules [m], shape (modules,).
        matrices: B, shape (modules, cables, 2).
        inverses: of B, shape (modules, 2, cables).
        radii: of the cables [m], shape (modules,).
        compliances: nominal lengths over bending stiffnesses [rad/(N m)], shape
            (modules,).
        taut_compliances: compliances of modules including their taut cables
            [rad/(N m)], shape (modules,).
        moments: bend of a cable tension of 1 N [rad/N], shape (modules, 1).
        weights: masses lumped at module ends, half of each adjacent module, and that
            of the tip [kg], shape (modules,).
        lateral_compliances: deflection of module ends under a lateral force at fixed
            axes, C L^2 / 12 [m/N], shape (modules,).
        gravity: [m/s2], base frame.
        slack: length by which cables are longer than at the training, over their radius
            [rad], shape (modules, cables), or (modules, 1) if all of a module are.
        softness: bending compliance over that at the training, shape (modules,).
    """

    lengths: PerModule
    matrices: Matrices
    inverses: Float[Array, "modules 2 cables"]
    radii: PerModule
    compliances: PerModule
    taut_compliances: PerModule
    moments: Float[Array, "modules 1"]
    weights: PerModule
    lateral_compliances: PerModule
    gravity: Float[Array, "3"]
    slack: Float[Array, "modules _"]
    softness: PerModule

    @classmethod
    def of(cls, arm: ArmSpec) -> "Trunk":
        """The constants of an arm."""
        geometry = ArmGeometry.of(arm)
        compliances = geometry.lengths / per_module(arm, "bending_stiffness")
        # the last end has half of the last module, and all that is at the tip
        masses = np.append(per_module(arm, "mass"), 2.0 * arm.tip.mass)
        arrays = (
            geometry.lengths,
            geometry.cable_matrices,
            geometry.bend_matrices,
            geometry.cable_radii,
            compliances,
            1.0 / (1.0 / compliances + TAUT * geometry.cable_springs),
            (compliances * geometry.cable_radii)[:, None],
            (masses[:-1] + masses[1:]) / 2.0,
            compliances * geometry.lengths**2 / 12.0,
            np.asarray(arm.gravity),
            np.zeros((arm.module_count, 1)),
            np.ones(arm.module_count),
        )
        return cls(*(jax.device_put(np.asarray(array, np.float32)) for array in arrays))

    def displacements(self, configurations: Configurations) -> Actions:
        """Cable displacements over the cable radius [rad]."""
        bends = bends_from_configurations(configurations)
        return jnp.einsum("mnk,...mk->...mn", self.matrices, bends)

    def bends(self, displacements: Actions) -> Bends:
        """Bends of cable displacements [rad], shape (*batch, modules, 2)."""
        return bends_from_cables(self.inverses, displacements)
