"""A learned controller of your own: least squares from the change of the bends.

    s2c2a train mine.episodes --recipe own_controller.toml --out mine.safetensors
    s2c2a run circle --weights mine.safetensors \\
        --trust own_controller.py:LinearOptions

own_controller.toml is based on the recipe `best` and names it in [c2a].
"""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from s2c2a.control import Controller
from s2c2a.control.options import ControllerOptions
from s2c2a.kinematics import PCC, bends_from_configurations
from s2c2a.training import FromArm, Trained, quiet


class ArmPCC(PCC, FromArm):
    """PCC with the arm's nominal geometry: it is rebuilt from the arm, not stored."""


class Linear(eqx.Module):
    """Matrix from desired bends to the bends that PCC converts to cables."""

    matrix: jnp.ndarray
    pcc: ArmPCC


class LinearController(Controller):
    """A matrix, then inverse PCC."""

    network: Linear

    def start(self, sensed):
        return ()

    def act(self, desired, sensed, memory):
        bends = bends_from_configurations(desired)
        corrected = (self.network.matrix @ bends.reshape(-1)).reshape(bends.shape)
        return self.network.pcc.actions(corrected), memory

    def sent(self, action, memory):
        return memory


@dataclass(frozen=True)
class LinearOptions(ControllerOptions):
    """The strength of the regularization."""

    ridge: float = 1e-3

    def untrained(self, arm, key):
        return Linear(jnp.eye(2 * arm.module_count), ArmPCC.of(arm))

    def train(self, data, history_noise, fit, key, progress=quiet):
        pcc = ArmPCC.of(data.arm)
        rows = (-1, 2 * data.arm.module_count)
        sensed = bends_from_configurations(jnp.asarray(data.sensed, jnp.float32))
        sensed = np.asarray(sensed).reshape(rows)
        commanded = pcc.bends(jnp.asarray(data.actions, jnp.float32))
        commanded = np.asarray(commanded).reshape(rows)
        square = sensed.T @ sensed + self.ridge * np.eye(rows[1])
        matrix = np.linalg.solve(square, sensed.T @ commanded).T
        network = Linear(jnp.asarray(matrix, jnp.float32), pcc)
        return Trained(network)

    def controller(self, network):
        return LinearController(network)
