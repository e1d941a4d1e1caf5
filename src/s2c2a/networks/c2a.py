"""C2A: the learned configuration controller."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.networks.bilstm import BiLSTM
from s2c2a.networks.scaling import Scaling
from s2c2a.networks.sum_and_range import SumAndRange
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY


class History(NamedTuple):
    """What the controller remembers, youngest first.

    Attributes:
        configurations: C_t to C_{t-3} as sensed, shape (*batch, modules, 4, 3).
        actions: A_{t-1} to A_{t-5}, normalised, shape (*batch, modules, 5, cables).
    """

    configurations: Float[Array, "*batch modules 4 3"]
    actions: Float[Array, "*batch modules 5 cables"]


def module_labels(modules: int) -> Float[Array, " modules"]:
    """n_m = 2 (m - 1) / (n_sum - 1) - 1 (Chen et al. 2025, eq. (9)); zero for a single module."""
    return jnp.linspace(-1.0, 1.0, modules) if modules > 1 else jnp.zeros(1)


class C2A(eqx.Module):
    """NN_C2A of the paper (Chen et al. 2025, eq. (8), fig. 5B), with its scaling.

    Attributes:
        network: the biLSTM NN_C2A'.
        configuration_scaling: of wanted and sensed configurations.
        sum_and_range: the last layer, and the normalisation of actions.
    """

    network: BiLSTM
    configuration_scaling: Scaling
    sum_and_range: SumAndRange

    @classmethod
    def untrained(cls, arm: ArmSpec, layers: int, hidden: int, key: PRNGKeyArray) -> "C2A":
        """Random weights and no scaling, for an arm."""
        features = 3 + 3 * CONFIGURATION_HISTORY + arm.cable_count * ACTION_HISTORY + 1
        network = BiLSTM(features, arm.cable_count, layers, hidden, key)
        return cls(network, Scaling.identity(3), SumAndRange.of(arm))

    def for_arm(self, arm: ArmSpec) -> "C2A":
        """The same weights for another arm with as many cables a module; the module count may differ."""
        return C2A(self.network, self.configuration_scaling, SumAndRange.of(arm))

    def __call__(
        self, wanted: Float[Array, "*batch modules 3"], history: History
    ) -> Float[Array, "*batch modules cables"]:
        """Normalised actions, within the arm's limits, that shall lead to the wanted configurations in one step."""
        scaling, layer = jax.lax.stop_gradient((self.configuration_scaling, self.sum_and_range))
        batch = wanted.shape[:-1]
        parts = [
            scaling.forward(wanted),
            scaling.forward(history.configurations).reshape(*batch, -1),
            history.actions.reshape(*batch, -1),
            jnp.broadcast_to(module_labels(batch[-1])[:, None], (*batch, 1)),
        ]
        return layer.limited(layer(self.network(jnp.concatenate(parts, axis=-1))))
