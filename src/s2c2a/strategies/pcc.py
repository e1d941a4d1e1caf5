"""The comparisons of the paper: PCC in the planner, inverse PCC behind it, no feedback."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.control import InversePCC
from s2c2a.data import Recording
from s2c2a.errors import RecordingError
from s2c2a.kinematics import PCC, PCCForwardModel, bends_from_configurations, configurations_from_states
from s2c2a.planning import Planner, PlannerOptions
from s2c2a.sensing import EncoderEstimator
from s2c2a.strategies.strategy import Strategy


def pcc_strategy(arm: ArmSpec, options: PlannerOptions) -> Strategy:
    """PCC with the arm's nominal numbers."""
    return _strategy("pcc", arm, options, np.ones(arm.module_count))


def pcc_fitted_strategy(recording: Recording, options: PlannerOptions) -> Strategy:
    """PCC with one gain a module, fitted on a recording."""
    return _strategy("pcc-fitted", recording.arm, options, 1.0 / fitted_gains(recording))


def fitted_gains(recording: Recording) -> Float[np.ndarray, " modules"]:
    """True bend over the bend that the cables say, per module, by least squares over all samples.

    Raises:
        RecordingError: episodes are missing, no true states, or a module that did not move.
    """
    recording.check_complete()
    said = np.asarray(PCC.of(recording.arm).bends(jnp.asarray(recording.sensor("cables"), dtype=jnp.float32)))
    states = jnp.asarray(recording.sensor("states"), dtype=jnp.float32)
    true = np.asarray(bends_from_configurations(configurations_from_states(states)))
    everything = (0, 1, 3)
    together, alone = (true * said).sum(axis=everything), (said**2).sum(axis=everything)
    if not (np.isfinite(together).all() and (together > 1e-6).all() and (alone > 1e-6).all()):
        raise RecordingError("gains cannot be fitted: the recording lacks true states, or a module stood still")
    return together / alone


def _strategy(name: str, arm: ArmSpec, options: PlannerOptions, gains: Float[np.ndarray, " modules"]) -> Strategy:
    pcc = PCC.of(arm)
    planner = Planner(arm, PCCForwardModel.of(arm), options)
    return Strategy(name, arm, EncoderEstimator(pcc), planner, InversePCC(pcc, jnp.asarray(gains, dtype=jnp.float32)))
