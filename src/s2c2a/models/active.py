"""Choice of targets where a local model is unsure: active collection of data.

A Gaussian process predicts the residual of the nominal kinematics, with the length scales
that the first half of a recording shows. Of many candidates, which are distributed as plans are
(`data.babbling.CoverageBabbling`), each next target reduces the variance at all
candidates the most (active learning of Cohn; Seo et al., Gaussian Process Regression: Active Data
Selection and Test Point Rejection, 2000). The candidate with the largest variance would
always be an extreme shape, which no plan needs.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry
from s2c2a.data.babbling import coverage_targets
from s2c2a.kinematics import bends_from_configurations, states_from_configurations
from s2c2a.models.kernels import KernelFit, matern
from s2c2a.training.trained import TrainingData

CANDIDATES = 1500
SAMPLES = 1500  # of the recording, evenly spread
NOISE = 0.02  # variance of a sample, relative to the kernel's
MIN_RATE = 0.3  # least inverse length scale, times the feature's standard deviation


def choose_targets(
    data: TrainingData, count: int, seed: int
) -> Float[np.ndarray, "count modules 2"]:
    """Targets that teach the most about plans, the most useful one first.

    Args:
        data: of the recording so far, with true states.
        count: number of targets.
        seed: of the candidates.

    Returns:
        Bends, in shares of the full bend.
    """
    geometry = ArmGeometry.of(data.arm)
    random = np.random.default_rng([seed, count])
    candidates = coverage_targets(geometry, max(CANDIDATES, count), random)
    bends = candidates * geometry.action_bends[:, None]
    seen, rates = _seen(data)
    scaled = bends.reshape(len(bends), -1) * rates
    covariance = _posterior(scaled, seen * rates)
    return candidates[_most_informative(covariance, count)]


def _seen(
    data: TrainingData,
) -> tuple[Float[np.ndarray, "samples bends"], Float[np.ndarray, " bends"]]:
    """Bends of the recording [rad], and inverse length scales of the residual [1/rad]."""
    sensed = jnp.asarray(data.sensed.reshape(-1, *data.sensed.shape[2:]))
    rows = np.linspace(0, len(sensed) - 1, min(SAMPLES, len(sensed))).astype(int)
    sensed = sensed[rows]
    bends = np.asarray(bends_from_configurations(sensed)).reshape(len(rows), -1)
    lengths = ArmGeometry.of(data.arm).lengths
    nominal = np.asarray(states_from_configurations(sensed, lengths))
    states = data.states.reshape(-1, *data.states.shape[2:])[rows]
    residual = (states - nominal).reshape(len(rows), -1)
    fit = KernelFit.of(bends, residual, np.eye(bends.shape[1]))
    least = MIN_RATE / np.maximum(bends.std(axis=0), 1e-6)
    if fit is None:
        return bends, least
    return bends, np.maximum(fit.rates, least)


def _posterior(
    candidates: Float[np.ndarray, "candidates features"],
    seen: Float[np.ndarray, "samples features"],
) -> Float[np.ndarray, "candidates candidates"]:
    """Covariance of the candidates, given the samples."""
    cross = matern(candidates, seen)
    noisy = matern(seen, seen) + NOISE * np.eye(len(seen))
    return matern(candidates, candidates) - cross @ np.linalg.solve(noisy, cross.T)


def _most_informative(
    covariance: Float[np.ndarray, "candidates candidates"], count: int
) -> list[int]:
    """Indices of candidates, each of which reduces the total variance the most."""
    remaining = covariance.copy()
    chosen: list[int] = []
    for _ in range(count):
        variances = np.diag(remaining) + NOISE
        reductions = np.sum(remaining**2, axis=0) / variances
        reductions[chosen] = -np.inf
        best = int(np.argmax(reductions))
        chosen.append(best)
        column = remaining[:, best]
        remaining = remaining - np.outer(column, column) / variances[best]
    return chosen
