"""C2S: the learned forward model, from configurations to states."""

import jax
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.kinematics.forward_model import Memory, MemorylessModel
from s2c2a.networks.bilstm import BiLSTM
from s2c2a.networks.scaling import Scaling


class C2S(MemorylessModel):
    """NN_C2S of the paper (Chen et al. 2025, fig. 5A), with its scaling.

    Example:
        >>> model = C2S.untrained(layers=4, hidden=64, key=jax.random.key(0))
        >>> model.predict(jnp.zeros((3, 3)), memory=()).shape
        (3, 6)
    """

    network: BiLSTM
    configuration_scaling: Scaling
    state_scaling: Scaling

    @classmethod
    def untrained(cls, layers: int, hidden: int, key: PRNGKeyArray) -> "C2S":
        """Random weights and no scaling."""
        return cls(BiLSTM(3, 6, layers, hidden, key), Scaling.identity(3), Scaling.identity(6))

    def predict(self, configurations: Float[Array, "*batch modules 3"], memory: Memory) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""
        scalings = jax.lax.stop_gradient((self.configuration_scaling, self.state_scaling))
        return scalings[1].back(self.network(scalings[0].forward(configurations)))
