"""Gaussian process regression, the strong rival on recordings of real arms.

Matern kernel of order 5/2 with a length scale for each input, and a linear part; all by
maximum marginal likelihood (Rasmussen and Williams, Gaussian Processes for Machine
Learning, 2006, secs. 2.2, 5.1 and 5.4.1). The posterior is exact.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float, PRNGKeyArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from s2c2a.logs.interpolation import evenly_spread
from s2c2a.models import ChainOptions
from s2c2a.models.residual_process import matern
from s2c2a.spaces import POSITION
from s2c2a.training import FitOptions, Trained, TrainingData, TrainingProgress, quiet
from s2c2a_experiments.real_models import (
    ReferenceModel,
    inputs_with_plays,
    without_curves,
)

ROWS = 2000  # of the posterior; evenly thinned above
LIKELIHOOD_ROWS = 1000  # a likelihood costs their cube
STEPS = 100  # of Adam; the likelihood no longer rises
LEARNING_RATE = 0.1
MIN_NOISE = 1e-4  # variance, relative to the targets': single precision
CHAIN = ChainOptions()


class Hyperparameters(NamedTuple):
    """Logarithms of the inverse length scales, and of variances."""

    rates: Array
    kernel: Array
    linear: Array
    noise: Array

    @classmethod
    def initial(cls, inputs: int) -> "Hyperparameters":
        """Where the ascent begins, for normalized inputs and targets."""
        rates = jnp.full(inputs, -0.5 * np.log(inputs))
        return cls(rates, *map(jnp.log, jnp.array([1.0, 0.0025, 0.01])))

    def covariance(self, x: Any, z: Any) -> Any:
        """Prior covariance between two sets of inputs, both NumPy or both JAX."""
        xp = x.__array_namespace__()
        rates = xp.exp(self.rates)
        linear = xp.exp(self.linear) * (x @ z.T)
        alike = matern(x * rates, z * rates)
        return xp.exp(self.kernel) * alike + linear


class GaussianProcess(NamedTuple):
    """Posterior of independent outputs with a common kernel.

    Attributes:
        center: of the inputs.
        scale: of the inputs; infinite for those that never vary.
        points: normalized inputs of the samples.
        logarithms: hyperparameters.
        root: lower Cholesky factor of the samples' covariance.
        weights: of the covariance with each sample.
        mean: of the targets; NaN if never known.
        spread: of the targets.
    """

    center: Float[np.ndarray, " inputs"]
    scale: Float[np.ndarray, " inputs"]
    points: Float[np.ndarray, "samples inputs"]
    logarithms: Hyperparameters
    root: Float[np.ndarray, "samples samples"]
    weights: Float[np.ndarray, "samples outputs"]
    mean: Float[np.ndarray, " outputs"]
    spread: Float[np.ndarray, " outputs"]

    def __call__(
        self, inputs: Float[np.ndarray, "others inputs"]
    ) -> tuple[
        Float[np.ndarray, "others outputs"], Float[np.ndarray, "others outputs"]
    ]:
        """Means and variances of new observations, noise included."""
        x = (inputs - self.center) / self.scale
        covariance = self.logarithms.covariance(x, self.points)
        means = covariance @ self.weights * self.spread + self.mean
        squares = np.sum(x**2, axis=1)
        linear = np.exp(self.logarithms.linear) * squares
        prior = np.exp(self.logarithms.kernel) + linear
        explained = solve_triangular(
            self.root, covariance.T, lower=True, check_finite=False
        )
        variances = np.maximum(prior - np.sum(explained**2, axis=0), 0.0)
        noisy = variances + np.exp(self.logarithms.noise) + MIN_NOISE
        return means, noisy[:, None] * self.spread**2


def fit_process(
    inputs: Float[np.ndarray, "samples inputs"],
    targets: Float[np.ndarray, "samples outputs"],
) -> GaussianProcess:
    """Fit to samples in order of time; NaN: unknown targets."""
    ever_known = np.isfinite(targets).any(axis=0)
    complete = np.flatnonzero(np.isfinite(targets[:, ever_known]).all(axis=1))
    rows = complete[evenly_spread(len(complete), ROWS)]
    x = inputs[rows].astype(float)
    y = targets[rows].astype(float)
    center = x.mean(axis=0)
    width = x.std(axis=0)
    scale = np.where(width > 1e-6 * width.max(), width, np.inf)
    points = (x - center) / scale
    mean = y.mean(axis=0)
    spread = np.maximum(y.std(axis=0), 1e-9)
    normalized = (y - mean) / spread
    thinned = evenly_spread(len(rows), LIKELIHOOD_ROWS)
    logarithms = _most_likely(
        jnp.asarray(points[thinned], jnp.float32),
        jnp.asarray(normalized[thinned][:, ever_known], jnp.float32),
    )
    logarithms = jax.tree.map(lambda each: np.asarray(each, float), logarithms)
    noise = np.exp(logarithms.noise) + MIN_NOISE
    covariance = logarithms.covariance(points, points) + noise * np.eye(len(points))
    root, _ = cho_factor(covariance, lower=True)
    weights = cho_solve((root, True), normalized, check_finite=False)
    return GaussianProcess(
        center, scale, points, logarithms, np.tril(root), weights, mean, spread
    )


@jax.jit
def _most_likely(x: Array, y: Array) -> Hyperparameters:
    """Maximize the marginal likelihood by gradient steps on logarithms."""
    optimizer = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, STEPS))

    def loss(logarithms: Hyperparameters) -> Array:
        noise = jnp.exp(logarithms.noise) + MIN_NOISE
        covariance = logarithms.covariance(x, x) + noise * jnp.eye(len(x))
        root = jnp.linalg.cholesky(covariance)
        whitened = jax.scipy.linalg.solve_triangular(root, y, lower=True)
        misfit = 0.5 * jnp.mean(jnp.sum(whitened**2, axis=0))
        return (misfit + jnp.sum(jnp.log(jnp.diag(root)))) / len(x)

    def step(carry: tuple, _: None) -> tuple[tuple, None]:
        logarithms, state = carry
        updates, state = optimizer.update(jax.grad(loss)(logarithms), state)
        return (optax.apply_updates(logarithms, updates), state), None

    initial = Hyperparameters.initial(x.shape[1])
    carry = initial, optimizer.init(initial)
    return jax.lax.scan(step, carry, None, STEPS)[0][0]


class ChainAndProcess(NamedTuple):
    """A trained chain, if any, and a process of its residual or of the states."""

    chain: Any
    process: GaussianProcess


@dataclass(frozen=True)
class Process(ReferenceModel):
    """A Gaussian process of the states, from displacements and their play operators.

    Attributes:
        chain: of the residual of a trained chain instead.
    """

    chain: bool = False
    model: str = field(default="Gaussian process", kw_only=True)

    def predictions(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules 6"]:
        means, _ = model.process(_rows(inputs_with_plays(data)))
        states = means.reshape(data.states.shape)
        return states + CHAIN.predictions(model.chain, data) if self.chain else states

    def deviations(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules"]:
        _, variances = model.process(_rows(inputs_with_plays(data)))
        positions = variances.reshape(data.states.shape)[..., POSITION]
        return np.sqrt(positions.sum(axis=-1))

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained:
        """See `ForwardOptions`; the process uses all known samples."""
        chain = None
        targets = data.states.copy()
        if self.chain:
            chain = CHAIN.train(data, fit, key, progress).network
            targets = targets - CHAIN.predictions(chain, data)
        for row, length in zip(targets, data.lengths or (), strict=False):
            row[length:] = np.nan
        process = fit_process(_rows(inputs_with_plays(data)), _rows(targets))
        return without_curves(ChainAndProcess(chain, process))


def _rows(values: np.ndarray) -> np.ndarray:
    """Samples of all episodes below each other, shape (samples, values)."""
    return values.reshape(values.shape[0] * values.shape[1], -1)
