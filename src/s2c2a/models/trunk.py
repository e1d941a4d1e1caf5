"""What a forward model knows of an arm by its description: lengths, cables, weights."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import bends_from_configurations
from s2c2a.training.fit import FromArm

TAUT = 0.5  # of an arm's cables, as a rule


class Trunk(FromArm):
    """Lengths and cables.

    Attributes:
        lengths: of modules [m], shape (modules,).
        matrices: B, shape (modules, cables, 2).
        inverses: of B, shape (modules, 2, cables).
        radii: of the cables [m], shape (modules,).
        compliances: nominal lengths over bending stiffnesses [rad/(N m)], shape
            (modules,).
        yields: the same of modules whose cables help to hold them [rad/(N m)], shape
            (modules,).
        moments: of a pull of one, over the bending stiffness [rad/N], shape (modules,
            1).
        weights: of modules, half at either end, but for what the base carries [kg],
            shape (modules,).
        gives: how far ends of modules move for a force across them, while their axes
            stay: C L^2 / 12 [m/N].
        gravity: [m/s2], base frame.
    """

    lengths: Float[Array, " modules"]
    matrices: Float[Array, "modules cables 2"]
    inverses: Float[Array, "modules 2 cables"]
    radii: Float[Array, " modules"]
    compliances: Float[Array, " modules"]
    yields: Float[Array, " modules"]
    moments: Float[Array, "modules 1"]
    weights: Float[Array, " modules"]
    gives: Float[Array, " modules"]
    gravity: Float[Array, "3"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "Trunk":
        """The numbers of an arm."""
        geometry = ArmGeometry.of(arm)
        compliances = np.array(
            [module.length / module.bending_stiffness for module in arm.modules]
        )
        masses = np.array([*(module.mass for module in arm.modules), 0.0])
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
        )
        return cls(*(jnp.asarray(array, dtype=jnp.float32) for array in arrays))

    def displacements(
        self, configurations: Float[Array, "*batch modules 3"]
    ) -> Float[Array, "*batch modules cables"]:
        """What sensed configurations say of the cables, over the cable radius [rad]."""
        return jnp.einsum(
            "mnk,...mk->...mn", self.matrices, bends_from_configurations(configurations)
        )

    def bends(
        self, displacements: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch modules 2"]:
        """The other way."""
        return jnp.einsum("mkn,...mn->...mk", self.inverses, displacements)
