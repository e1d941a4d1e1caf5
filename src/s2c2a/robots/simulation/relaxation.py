"""A body that relaxes: Maxwell elements beside its springs, which slowly get used to a held shape.

A spring of stiffness k of which the parts s_i relax pulls with k (q - sum_i s_i z_i),
where z_i follows the turn q with the time constant tau_i. That is the same spring about
another rest, so MuJoCo needs no more than that rest, and it is slow enough to be moved
once a control step.
"""

import mujoco
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.robots.simulation.chain import module_of_joint

Turns = Float[np.ndarray, " joints"]


class Relaxation:
    """What every joint of a body has got used to.

    Attributes:
        rests: of the joints that have got used to nothing [rad or m], shape (joints,).
        used_to: turn away from there that each element has got used to, shape (joints,
            elements).
    """

    def __init__(self, arm: ArmSpec, model: mujoco.MjModel):
        modules = [
            module_of_joint(model.joint(joint).name) for joint in range(model.njnt)
        ]
        self._parts = per_module(arm, "mismatch.relaxing")[modules]
        self._times = per_module(arm, "mismatch.relaxation_times")[modules]
        self.rests = model.qpos_spring.copy()
        self.used_to = np.zeros_like(self._parts)

    @property
    def springs(self) -> Turns:
        """Where the joints' springs pull to now [rad or m]."""
        return self.rests + np.sum(self._parts * self.used_to, axis=-1)

    def advance(self, turns: Turns, seconds: float) -> None:
        """Let time pass.

        Args:
            turns: mean turn of every joint meanwhile [rad or m].
            seconds: how much.
        """
        shares = 1.0 - np.exp(-seconds / self._times)
        self.used_to = self.used_to + shares * (
            (turns - self.rests)[:, None] - self.used_to
        )
