"""A forward model of your own: constant-curvature arcs and a network for the residual.

    s2c2a train mine.episodes --recipe own_model.toml --out mine.safetensors
    s2c2a run circle --weights mine.safetensors --trust own_model.py:ArcsOptions

own_model.toml is based on the recipe `paper`; its section [c2s] names this model and its
options.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp

from s2c2a.data import forward_samples
from s2c2a.kinematics import bends_from_configurations
from s2c2a.models import ForwardOptions
from s2c2a.models.forward_model import MemorylessModel, PCCForwardModel
from s2c2a.training import FitOptions, Trained, TrainingData, quiet, train


class Arcs(MemorylessModel):
    """PCC plus a residual; all arrays are trained, except those of type `Fixed`."""

    arcs: PCCForwardModel
    network: eqx.nn.MLP

    def predict(self, configurations, memory, disturbances=None):
        """States [m, 1], shape (*batch, modules, 6), base frame."""
        bends = bends_from_configurations(configurations)  # (*batch, modules, 2)
        flat = bends.reshape(-1, bends.shape[-2] * bends.shape[-1])
        residual = jax.vmap(self.network)(flat).reshape(*configurations.shape[:-1], 6)
        return self.arcs.predict(configurations, memory) + 0.1 * residual


@dataclass(frozen=True)
class ArcsOptions(ForwardOptions):
    """Options that build and train it; with the arm they determine all array shapes."""

    hidden: int = 32

    def untrained(self, arm, key) -> Arcs:
        network = eqx.nn.MLP(
            2 * arm.module_count, 6 * arm.module_count, self.hidden, depth=1, key=key
        )
        return Arcs(PCCForwardModel.of(arm), network)

    def train(
        self, data: TrainingData, fit: FitOptions, key, progress=quiet
    ) -> Trained[Arcs]:
        network_key, fit_key = jax.random.split(key)
        model = self.untrained(data.arm, network_key)
        split = forward_samples(data.sensed, data.states)
        return train(model, loss, answer, split, fit, fit_key, progress)


def answer(model, batch):
    return model.predict(batch["configurations"], ())


def loss(model, batch, key):
    return jnp.mean((answer(model, batch) - batch["targets"]) ** 2)
