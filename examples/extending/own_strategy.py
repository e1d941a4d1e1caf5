"""A strategy of your own: resolved-rate control with the Jacobian of PCC.

    s2c2a run circle --strategy s2c2a own_strategy.py:ResolvedRate

It learns one gain per module from data. The command compares it with the paper's
strategy in one table. A strategy without training implements `build` alone.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.estimation import EncoderEstimator, EncoderMap
from s2c2a.kinematics import PCC, bends_from_configurations, limit_lengths
from s2c2a.kinematics.chain import states_from_bends
from s2c2a.strategies import StrategyOptions, TrainedNetworks, fitted_gains
from s2c2a.training import Trained


@dataclass(frozen=True)
class ResolvedRate(StrategyOptions):
    """Bends change along the damped pseudo-inverse of the tip's Jacobian."""

    damping: float = 0.05
    name = "resolved-rate"

    def collect_options(self, recipe, seed):
        return recipe.collect_options(seed)

    def untrained(self, arm, recipe, key):
        return {"gains": jnp.ones(arm.module_count)}

    def train(self, recording, recipe, seed, progress=lambda *_: None):
        gains = jnp.asarray(fitted_gains(recording), jnp.float32)
        return TrainedNetworks(recording.arm, recipe, seed, {"gains": Trained(gains)})

    def build(self, arm, recipe, trained, run):
        return Driver(arm, trained.networks["gains"][:, None], self.damping)


class Driver:
    """Interface to the control loop: estimate, plan, act."""

    name = "resolved-rate"

    def __init__(self, arm, gains, damping):
        self.arm, self.pcc = arm, PCC.of(arm)
        self.estimator = EncoderEstimator(EncoderMap(self.pcc))
        self.sensors = self.estimator.sensors
        lengths = jnp.asarray([module.length for module in arm.modules])
        step_limit = ArmGeometry.of(arm).step_limit

        def next_bends(bends, target):
            tip = lambda bends: states_from_bends(gains * bends, lengths)[-1, :3]  # noqa: E731
            jacobian = jax.jacfwd(tip)(bends).reshape(3, -1)
            square = jacobian @ jacobian.T + damping**2 * jnp.eye(3)
            change = jacobian.T @ jnp.linalg.solve(square, target - tip(bends))
            return bends + limit_lengths(change.reshape(-1, 2), step_limit)

        self.next_bends = jax.jit(next_bends)

    def start(self, reading):
        configuration = self.estimator.start(reading).configuration
        self.bends = bends_from_configurations(configuration)

    def estimate(self, reading, last_command):
        return self.estimator.start(reading)

    def plan(self, estimate, goal):
        if goal.position_weights[-1] > 0.0:
            self.bends = self.next_bends(self.bends, jnp.asarray(goal.positions[-1]))
        return self.bends

    def act(self, plan, estimate):
        return np.asarray(self.pcc.actions(plan), float)

    def sent(self, action):
        self.bends = self.pcc.bends(jnp.asarray(action, jnp.float32))

    def diagnostics(self):
        return {}
