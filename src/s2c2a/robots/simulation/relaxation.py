"""Stress relaxation of the modules: Maxwell elements parallel to the joint springs.

A spring of stiffness k with relaxing shares s_i has the torque k (q - sum_i s_i z_i),
where z_i follows the joint position q with the time constant tau_i. This is the same
spring with another reference position. Relaxation is slow, so the reference moves only
once a control step.
"""

import mujoco
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.robots.simulation.chain import module_of_joint

JointPositions = Float[np.ndarray, " joints"]


class Relaxation:
    """Relaxation state of every joint.

    Attributes:
        references: spring references without relaxation [rad or m], shape (joints,).
        relaxed: relaxed displacements z of the elements from there, shape (joints,
            elements).
    """

    def __init__(self, arm: ArmSpec, model: mujoco.MjModel):
        joints = range(model.njnt)
        modules = [module_of_joint(model.joint(joint).name) for joint in joints]
        self._shares = per_module(arm, "mismatch.relaxing")[modules]
        self._time_constants = per_module(arm, "mismatch.relaxation_times")[modules]
        self.references = model.qpos_spring.copy()
        self.relaxed = np.zeros_like(self._shares)

    @property
    def spring_references(self) -> JointPositions:
        """Current references of the joint springs [rad or m]."""
        return self.references + np.sum(self._shares * self.relaxed, axis=-1)

    def advance(self, positions: JointPositions, seconds: float) -> None:
        """Relax for some time.

        Args:
            positions: mean joint positions in this time [rad or m].
            seconds: duration [s].
        """
        shares = 1.0 - np.exp(-seconds / self._time_constants)
        displacements = (positions - self.references)[:, None]
        self.relaxed = self.relaxed + shares * (displacements - self.relaxed)
