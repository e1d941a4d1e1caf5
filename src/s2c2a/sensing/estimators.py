"""Estimators: what the arm's configuration is, as far as its sensors can tell."""

from abc import abstractmethod

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.kinematics import PCC, configurations_from_bends

PAPER_COUPLING = ((0.85, 0.10, 0.05), (0.20, 0.70, 0.10), (0.15, 0.30, 0.55))
"""How the configurations of three modules leak into each other's sensors (Chen et al. 2025, eq. (11))."""

Cables = Float[Array | np.ndarray, "*batch modules cables"]
Configurations = Float[Array | np.ndarray, "*batch modules 3"]
Sensed = Float[Array, "*batch modules 3"]


class Estimator(eqx.Module):
    """A map from what was measured to configurations, for one moment or a whole recording."""

    @abstractmethod
    def __call__(self, cables: Cables, truth: Configurations | None) -> Sensed:
        """Sensed configurations, shape (*batch, modules, 3), module frames.

        Args:
            cables: measured displacements [m] or tensions [N].
            truth: true configurations where something outside measures them, else None.
        """


class EncoderEstimator(Estimator):
    """Configurations from the cables' readings through PCC (Chen et al. 2025, eqs. (2) and (3))."""

    pcc: PCC

    def __call__(self, cables: Cables, truth: Configurations | None) -> Sensed:
        """See `Estimator`."""
        return configurations_from_bends(self.pcc.bends(cables))


class TrueEstimator(Estimator):
    """The true configurations: simulation, or a real arm under motion capture."""

    def __call__(self, cables: Cables, truth: Configurations | None) -> Sensed:
        """See `Estimator`.

        Raises:
            S2C2AError: nothing measures the true configuration.
        """
        if truth is None:
            raise S2C2AError(
                "this arm senses its true configuration, but the robot's readings hold none; "
                'set sensing = "encoders" in the arm file'
            )
        return jnp.asarray(truth, dtype=jnp.float32)


class CoupledEstimator(Estimator):
    """Another estimator's configurations, mixed between modules: sensors that pass through the whole arm.

    The mixed vectors are shorter than one.
    """

    inner: Estimator
    coupling: Float[Array, "modules modules"]

    def __call__(self, cables: Cables, truth: Configurations | None) -> Sensed:
        """See `Estimator`."""
        return jnp.einsum("ij,...jk->...ik", self.coupling, self.inner(cables, truth))


class DirectionEstimator(Estimator):
    """Another estimator's configurations at unit length, whatever mixes them: two numbers a module, as in a bend."""

    inner: Estimator

    def __call__(self, cables: Cables, truth: Configurations | None) -> Sensed:
        """See `Estimator`."""
        sensed = self.inner(cables, truth)
        return sensed / jnp.linalg.norm(sensed, axis=-1, keepdims=True)


def estimator_for(arm: ArmSpec) -> Estimator:
    """The estimator that an arm file asks for: its `sensing`, under its `sensing_coupling` if it has one."""
    estimator: Estimator = TrueEstimator() if arm.sensing == "true" else EncoderEstimator(PCC.of(arm))
    if arm.sensing_coupling is None:
        return estimator
    return CoupledEstimator(estimator, jnp.asarray(arm.sensing_coupling, dtype=jnp.float32))
