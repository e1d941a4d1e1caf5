"""A policy without training: damped least squares on arcs of constant curvature.

With the Jacobian J of the tip's position at the commanded bends and the error e of the
tip, it changes the bends by

    g J^T (J J^T + d^2 I)^-1 e

It knows neither gravity nor cables; feedback of the tip makes up for that. It is a
baseline of trained policies, and their teacher (`examples/extending/train_policy.py`).
"""

import jax
import numpy as np
from jaxtyping import Array, Float

from s2c2a.integrations.environments.spaces import (
    OFFSET_UNIT,
    Controls,
    observation_parts,
)
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.spaces import POSITION

# Measured on twin_arm, 100 goals of Reach: with 0.17 arm lengths (0.1 m), 8 of them are
# not reached, since the arm gets stuck; with 0.1 m and a gain of 0.6, it oscillates.
GAIN = 0.5
DAMPING = 0.5  # arm lengths


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

    def actions(
        self, observations: Float[np.ndarray, "batch values"]
    ) -> Float[np.ndarray, "batch controls"]:
        """Actions of a batch, within [-1, 1]."""
        length = self._controls.arm.length
        bends = observations[:, self._parts["commanded_bends"]]
        errors = OFFSET_UNIT * length * observations[:, self._parts["goal_offset"]]
        jacobians = np.asarray(self._jacobians(bends.astype(np.float32)))
        transposed = jacobians.transpose(0, 2, 1)
        damped = jacobians @ transposed + (DAMPING * length) ** 2 * np.eye(3)
        changes = transposed @ np.linalg.solve(damped, errors[..., None])
        steps = GAIN * changes[..., 0] / self._controls.geometry.step_limit
        return np.clip(steps, -1.0, 1.0)
