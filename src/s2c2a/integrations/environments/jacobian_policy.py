"""A policy without training: damped least squares on arcs of constant curvature.

With the Jacobian J of the tip's position at the commanded bends q, the error e of the tip
and the motion v of the goal in the next step, it changes the bends by

    J^T (J J^T + d^2 I)^-1 (g e + v) - h (I - J^+ J) q

The last term leads motions that do not move the tip back to small bends, without which
they drift toward the limits. It knows neither gravity nor cables; feedback of the tip
makes up for that. It is a baseline of trained policies, and their teacher
(`examples/extending/train_policy.py`).
"""

import jax
import numpy as np
from jaxtyping import Array, Float

from s2c2a.integrations.environments.spaces import (
    OFFSET_UNIT,
    BatchValues,
    Controls,
    observation_parts,
)
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.spaces import POSITION

# Measured on twin_arm, 100 goals of Reach: with 0.17 arm lengths (0.1 m), 8 of them are
# not reached, since the arm gets stuck; with 0.1 m and a gain of 0.6, it oscillates.
GAIN = 0.5
DAMPING = 0.5  # arm lengths
# Measured likewise with 20 episodes of Track: the worst error is 3.8 cm with it and 6.0 cm
# without; that of Reach is equal.
NULL_SPACE_GAIN = 0.1
RANK = (
    0.05  # of the largest singular value; a straight arm has no motion along its axis
)


class JacobianPolicy:
    """Actions from observations of the tip's error; see the formula of this module.

    Args:
        controls: of the arm.
    """

    def __init__(self, controls: Controls):
        self._controls = controls
        self._parts = observation_parts(controls)
        self._lengths = controls.geometry.lengths.astype(np.float32)
        self._jacobians = jax.jit(jax.vmap(jax.jacfwd(self._tip)))

    def _tip(self, bends: Float[Array, " controls"]) -> Float[Array, "3"]:
        basis = self._controls.basis.astype(np.float32)
        per_module = jax.numpy.einsum("kmi,k->mi", basis, bends)
        return states_from_bends(per_module, self._lengths)[-1, POSITION]

    def actions(self, observations: BatchValues) -> Float[np.ndarray, "batch controls"]:
        """Actions of a batch, within [-1, 1]."""
        bends = observations[:, self._parts["commanded_bends"]]
        errors = observations[:, self._parts["goal_offset"]]
        motions = observations[:, self._parts["goal_change"]]
        unit = OFFSET_UNIT * self._controls.arm.length
        wanted = unit * (GAIN * errors + motions)  # of the tip [m]
        damping = (DAMPING * self._controls.arm.length) ** 2 * np.eye(3)
        jacobians = np.asarray(self._jacobians(bends.astype(np.float32)))
        transposed = jacobians.transpose(0, 2, 1)
        damped = jacobians @ transposed + damping
        moved = transposed @ np.linalg.solve(damped, wanted[..., None])
        moving = np.linalg.pinv(jacobians, RANK) @ jacobians
        without_effect = bends[..., None] - moving @ bends[..., None]
        changes = (moved - NULL_SPACE_GAIN * without_effect)[..., 0]
        return np.clip(changes / self._controls.geometry.step_limit, -1.0, 1.0)
