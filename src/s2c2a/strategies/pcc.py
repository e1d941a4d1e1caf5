"""The comparisons of the paper without learning: PCC in planner and controller.

They have no feedback.
"""

from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.control import InversePCC
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.estimation import EncoderEstimator, EncoderMap
from s2c2a.kinematics import PCC, bends_from_states
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a.planning import PAPER, Planner, PlannerOptions
from s2c2a.strategies.options import StrategyOptions
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.strategy import Strategy
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import Trained
from s2c2a.training.fit import Fixed

Gains = Float[np.ndarray, " modules"] | float
GAINS = "gains"
PLANNING_KEYS = frozenset({"planner", "axis_weights"})
"""Keys of a recipe that count without networks."""
MIN_MOTION = 1e-6  # rad2; a module that moves less cannot be fitted


@dataclass(frozen=True)
class PlainPCC(StrategyOptions):
    """PCC with the arm's nominal numbers."""

    name = "pcc"
    supports = frozenset({"guard"})
    recipe_keys = PLANNING_KEYS

    def build(self, arm, recipe, trained, run) -> Strategy:
        options = replace(recipe.planner, guard=run.guard)
        return pcc_strategy(arm, options, 1.0 / self.gains(trained), self.name)

    def gains(self, trained: TrainedNetworks | None) -> Gains:
        """True bend over the bend by the encoders."""
        return 1.0


class FittedGains(Fixed):
    """Gains of the modules.

    Attributes:
        gains: true bend over the bend by the encoders, shape (modules,).
    """

    gains: Float[Array, " modules"]


@dataclass(frozen=True)
class FittedPCC(PlainPCC):
    """PCC with one gain per module, fitted to a recording."""

    name = "pcc-fitted"
    recipe_keys = PLANNING_KEYS | {"babbling", "speeds", "episodes"}

    def collect_options(self, recipe: Recipe, seed: int) -> CollectOptions:
        return recipe.collect_options(seed)

    def training_key(self, recipe: Recipe) -> Any:
        """See `StrategyOptions`: the recipe matters to the recording alone."""
        return repr(self)

    def untrained(self, arm, recipe, key) -> dict[str, Any]:
        return {GAINS: FittedGains(jnp.ones(arm.module_count))}

    def train(self, recording, recipe, seed, progress=lambda *_: None):
        gains = FittedGains(jnp.asarray(fitted_gains(recording), jnp.float32))
        return TrainedNetworks(recording.arm, recipe, seed, {GAINS: Trained(gains)})

    def gains(self, trained: TrainedNetworks | None) -> Gains:
        if trained is None:
            raise StrategyError("pcc-fitted needs gains fitted to a recording")
        return np.asarray(trained.trained[GAINS].network.gains, float)


def pcc_strategy(
    arm: ArmSpec,
    options: PlannerOptions = PAPER,
    gains: Gains = 1.0,
    name: str = "pcc",
) -> Strategy:
    """PCC with the arm's nominal numbers, which needs no training.

    Args:
        arm: that it will drive.
        options: of the planner.
        gains: by which the controller multiplies bends, of each module or of all.
        name: in records.
    """
    pcc = PCC.of(arm)
    factors = jnp.broadcast_to(jnp.asarray(gains, jnp.float32), arm.module_count)
    return Strategy(
        name,
        arm,
        EncoderEstimator(EncoderMap(pcc)),
        Planner(arm, PCCForwardModel.of(arm), options),
        InversePCC(pcc, factors),
    )


def fitted_gains(recording: Recording) -> Float[np.ndarray, " modules"]:
    """True bend over the bend by the encoders, per module, by least squares.

    Raises:
        RecordingError: episodes or true states are missing, or a module did not move.
    """
    recording.check_complete()
    cables = jnp.asarray(recording.sensor("cables"), dtype=jnp.float32)
    sensed = np.asarray(PCC.of(recording.arm).bends(cables))
    states = jnp.asarray(recording.sensor("states"), dtype=jnp.float32)
    true = np.asarray(bends_from_states(states))
    all_but_modules = (0, 1, 3)
    is_known = np.isfinite(true * sensed)
    product = np.sum(true * sensed, axis=all_but_modules, where=is_known)
    squared = np.sum(sensed**2, axis=all_but_modules, where=is_known)
    is_usable = (product > MIN_MOTION) & (squared > MIN_MOTION)
    if not is_usable.all():
        raise RecordingError(
            "gains cannot be fitted: the recording lacks true states, or a module did "
            "not move"
        )
    return product / squared
