"""Forward model and optimization on pseudo-rigid links [15AMb; 18CS for the model].

A module is a chain of rigid links with universal joints, each with an equal share of the
bend that the cables command, less what they stretch. The weight of the links bends the
joints further, against the stiffness of module and cables; a few fixed-point iterations
find by how much. Each control step, damped least squares choose the bends, as on arcs.
"""

from dataclasses import dataclass
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.kinematics import (
    bends_from_configurations,
    configurations_from_bends,
    limit_lengths,
)
from s2c2a.kinematics.chain import States, rotations_to
from s2c2a.models.arrays import PerModule
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import Memory, MemorylessModel
from s2c2a.models.trunk import Trunk
from s2c2a.plugins.components import Ranges
from s2c2a_experiments.planners.one_step import OneStep

SAG_ITERATIONS = 3  # chosen: the weight of an arm bends it by a part of its bends
LARGEST_SAG = 1.0  # rad of a module; a softer arm topples, and no iteration converges

Joints = Float[Array, "*batch joints 2"]
Points = Float[Array, "*batch joints 3"]


class LinkModel(MemorylessModel):
    """Chains of rigid links that carry their weight.

    Attributes:
        lengths: of modules [m], shape (modules,).
        masses: of modules [kg], shape (modules,).
        compliances: of modules without cables [rad/(N m)], shape (modules,).
        held: share of a mean moment that the cables hold, shape (modules,).
        passed: share of the commanded bend that elastic cables pass on, shape
            (modules,).
        gravity: [m/s2], base frame, shape (3,).
        links: universal joints of a module.
    """

    lengths: PerModule
    masses: PerModule
    compliances: PerModule
    held: PerModule
    passed: PerModule
    gravity: Float[Array, "3"]
    links: int = eqx.field(static=True)

    @classmethod
    def of(cls, arm: ArmSpec, links: int, stiffness: float) -> "LinkModel":
        """The model with the arm's nominal numbers.

        Args:
            arm: with lengths, masses, stiffnesses and cables.
            links: joints of a module.
            stiffness: of the modules over their nominal one.
        """
        trunk = Trunk.of(arm)
        taut = 1.0 / trunk.taut_compliances
        cables = taut - 1.0 / trunk.compliances
        compliances = trunk.compliances / stiffness
        both = cables + 1.0 / compliances
        held = cables / both
        passed = jnp.ones_like(held)
        if arm.actuation == "displacement":
            passed = held
        masses = jnp.asarray(per_module(arm, "mass"), jnp.float32)
        return cls(
            trunk.lengths, masses, compliances, held, passed, trunk.gravity, links
        )

    def predict(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: Memory,
        disturbances: Disturbances | None = None,
    ) -> States:
        """See `ForwardModel`: bend biases are added to the bends."""
        bends = bends_from_configurations(configurations)
        if disturbances is not None:
            bends = bends + disturbances.bend_biases
        shares = self.passed[:, None] * bends / self.links
        commanded = jnp.repeat(shares, self.links, axis=-2)
        joints = commanded
        for _ in range(SAG_ITERATIONS):
            # bends of joints by the weight of all links beyond them [rad]
            moments = self._moments(joints)
            shape = (*joints.shape[:-2], -1, self.links, 2)
            moments = moments.reshape(shape)  # (*batch, modules, links, 2)
            mean = moments.mean(axis=-2, keepdims=True)
            held = self.held[:, None, None] * mean
            free = moments - held
            compliances = self.compliances[:, None, None] / self.links
            sag = limit_lengths(compliances * free, LARGEST_SAG / self.links)
            sag = sag.reshape(joints.shape)
            joints = commanded + sag
        points, rotations = self._chain(joints)
        outermost = slice(self.links - 1, None, self.links)
        axes = rotations[..., outermost, :, 2]
        halves = self.lengths[:, None] / (2.0 * self.links)
        ends = points[..., outermost, :] + halves * axes
        return jnp.concatenate([ends, axes], axis=-1)

    def _moments(self, joints: Joints) -> Joints:
        """Moments at joints by the weight of all links beyond them [N m]."""
        points, rotations = self._chain(joints)
        masses = self._of_links(self.masses)[:, None]
        weighted = _beyond(masses * points)
        levers = weighted - _beyond(masses) * points
        turning = jnp.cross(levers, self.gravity)
        local = jnp.einsum("...ji,...j->...i", rotations, turning)
        about_x = local[..., 0]
        about_y = local[..., 1]
        return jnp.stack([about_y, -about_x], axis=-1)

    def _of_links(self, values: PerModule) -> Float[Array, " joints"]:
        """Equal shares of the links in values of their modules."""
        shares = values / self.links
        return jnp.repeat(shares, self.links)

    def _chain(
        self, joints: Joints
    ) -> tuple[Points, Float[Array, "*batch joints 3 3"]]:
        """Positions of joints [m], and rotations beyond them, base frame."""
        configurations = configurations_from_bends(joints)
        turns = rotations_to(configurations)
        turns = jnp.moveaxis(turns, -3, 0)
        spans = self._of_links(self.lengths)
        batch = joints.shape[:-2]

        def add_joint(base, joint):
            point, rotation, half_before = base
            turn, span = joint
            half = span / 2.0
            along = half_before + half
            axis = rotation[..., :, 2]
            point = point + along * axis
            rotation = rotation @ turn
            return (point, rotation, half), (point, rotation)

        origin = jnp.zeros((*batch, 3))
        upright = jnp.broadcast_to(jnp.eye(3), (*batch, 3, 3))
        base = origin, upright, jnp.zeros(())
        _, (points, rotations) = jax.lax.scan(add_joint, base, (turns, spans))
        points = jnp.moveaxis(points, 0, -2)
        rotations = jnp.moveaxis(rotations, 0, -3)
        return points, rotations


def _beyond(values: Float[Array, "*batch joints axes"]) -> Array:
    """Sum over all joints beyond each one."""
    inward = jnp.flip(values, -2)
    sums = jnp.cumsum(inward, -2)
    return jnp.flip(sums, -2) - values


@dataclass(frozen=True)
class PseudoRigid(OneStep):
    """One step by least squares on chains of rigid links with weight.

    Attributes:
        links: universal joints of a module.
        stiffness: of the modules over their nominal one.
    """

    links: int = 4
    stiffness: float = 1.0
    name = "pseudo-rigid"
    limits: ClassVar[Ranges] = {
        **OneStep.limits,
        "links": (1, 20),
        "stiffness": (0.05, 20.0),
    }

    def model(self, arm: ArmSpec) -> LinkModel:
        """Links with the arm's nominal numbers."""
        return LinkModel.of(arm, self.links, self.stiffness)
