"""The C2A controller, and the loss of networks for actions."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.models.arrays import Actions, Configurations
from s2c2a.models.layers import Scaling, SumAndRange
from s2c2a.paper import BiLSTM, History, controller_inputs
from s2c2a.training.fit import Batch


class C2A(eqx.Module):
    """NN_C2A of the paper (Chen et al. 2025, eq. (8), fig. 5B), with its scaling.

    Attributes:
        network: the biLSTM NN_C2A'.
        configuration_scaling: of desired and sensed configurations.
        sum_and_range: the last layer, and the normalization of actions.
    """

    network: BiLSTM
    configuration_scaling: Scaling
    sum_and_range: SumAndRange

    def __call__(self, desired: Configurations, history: History) -> Actions:
        """Normalized actions that reach the desired configurations in one step.

        They are within the limits of the arm.
        """
        inputs = controller_inputs(self.configuration_scaling, desired, history)
        raw = self.network(inputs)
        return self.sum_and_range.limited(self.sum_and_range(raw))


def predict_actions(model: C2A, batch: Batch) -> Array:
    """Predicted actions of a batch, normalized."""
    return model(batch["desired"], History(batch["configurations"], batch["actions"]))


class NoisyLoss(eqx.Module):
    """Mean squared error of actions, with noise on past ones in training.

    A module, so that trainings of equal shapes share a compiled program.

    Attributes:
        predict: (network, batch) -> normalized actions.
        std: standard deviation of the noise, normalized.
    """

    predict: Callable[[Any, Batch], Array]
    std: float

    def __call__(
        self, model: eqx.Module, batch: Batch, key: PRNGKeyArray | None
    ) -> Float[Array, ""]:
        targets = batch["targets"]
        # without noise the network learns to repeat its past actions, and diverges in
        # closed loop (docs/concepts/deviations.md)
        if key is not None:
            past = batch["actions"]
            noise = self.std * jax.random.normal(key, past.shape)
            batch = batch | {"actions": past + noise}
        return jnp.mean((self.predict(model, batch) - targets) ** 2)
