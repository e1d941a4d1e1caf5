"""A local model: what data near a point say.

Regression with a Matern kernel whose length differs from feature to feature, beside a
linear part that goes on where there are no data, on a fixed number of points that stand
for all (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, secs.
4.2, 5.4 and 8.3.3: subset of regressors). Lengths maximize the likelihood of some of
the samples; the rest is linear algebra.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from s2c2a.training.fit import Fixed

Numbers = Array | np.ndarray
SAMPLES_OF_LIKELIHOOD = 700
# of Adam, on logarithms
STEPS = 60
LEARNING_RATE = 0.1
MIN_NOISE = 1e-4  # of the targets' variance
FIRST_LINEAR = 0.05  # standard deviation of slopes before anything is seen
FIRST_NOISE = 0.01
MIN_SAMPLES = 100


class Kernels(Fixed):
    """A function of features that was fitted once.

    Attributes:
        center: of the features, shape (features,).
        rates: one over the length of each feature; zero where it says nothing, shape
            (features,).
        points: centered and scaled features that stand for all samples, shape (points,
            features).
        weights: of the kernel at each point, shape (points, outputs).
        slopes: of the linear part in scaled features, shape (features, outputs).
        constant: shape (outputs,).
        speaks: one, or zero where it says nothing.
    """

    center: Float[Array, " features"]
    rates: Float[Array, " features"]
    points: Float[Array, "points features"]
    weights: Float[Array, "points outputs"]
    slopes: Float[Array, "features outputs"]
    constant: Float[Array, " outputs"]
    speaks: Float[Array, ""]

    @classmethod
    def silent(cls, features: int, outputs: int, points: int) -> "Kernels":
        """One that says nothing."""
        shapes = (
            (features,),
            (features,),
            (points, features),
            (points, outputs),
            (features, outputs),
            (outputs,),
            (),
        )
        return cls(*map(jnp.zeros, shapes))

    def times(self, weight: float) -> "Kernels":
        """One that says so much of it."""
        parts = self.weights, self.slopes, self.constant
        return eqx.tree_at(
            lambda k: (k.weights, k.slopes, k.constant),
            self,
            tuple(weight * part for part in parts),
        )

    def scaled(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch features"]:
        """As distances are taken."""
        return (features - self.center) * self.rates

    def __call__(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch outputs"]:
        """What the data say, shape (*batch, outputs)."""
        place = self.scaled(features)
        return (
            matern(place, self.points) @ self.weights
            + place @ self.slopes
            + self.constant
        )


def matern(
    places: Float[Numbers, "*batch features"], points: Float[Numbers, "points features"]
):
    """(1 + d + d^2 / 3) exp(-d) with d = sqrt(5) |x - z|, shape (*batch, points); slope zero at zero.

    In NumPy or JAX, as the result then is.
    """
    xp = points.__array_namespace__()
    squared = (
        xp.sum(places**2, axis=-1)[..., None]
        + xp.sum(points**2, axis=-1)
        - 2.0 * places @ points.T
    )
    distance = xp.sqrt(5.0 * xp.maximum(squared, 1e-9))
    return (1.0 + distance + distance**2 / 3.0) * xp.exp(-distance)


def fitted_kernels(
    features: Float[np.ndarray, "samples features"],
    targets: Float[np.ndarray, "samples outputs"],
    kinds: Float[np.ndarray, "features kinds"],
    count: int,
    seed: int = 0,
) -> Kernels:
    """Fit a local model.

    Args:
        features: of samples, in order of time.
        targets: what to say there, in units alike; outputs that are never known are
            left at zero.
        kinds: groups of features that share a factor of their lengths, as sums of
            one-hot rows.
        count: of points that stand for all samples.
        seed: of the choice of samples.
    """
    known = np.isfinite(targets).any(axis=0)
    whole = np.isfinite(targets[:, known]).all(axis=1) & np.isfinite(features).all(
        axis=1
    )
    x = features[whole].astype(np.float64)
    y = targets[whole][:, known].astype(np.float64)
    outputs = targets.shape[1]
    if len(x) < MIN_SAMPLES or not known.any():
        return Kernels.silent(features.shape[1], outputs, count)
    center = x.mean(axis=0)
    width = x.std(axis=0)
    mean = y.mean(axis=0)
    spread = max(float(np.sqrt(((y - mean) ** 2).mean())), 1e-9)
    rates = np.where(width > 1e-6, 1.0 / np.maximum(width, 1e-6), 0.0)
    chosen = np.random.default_rng(seed).permutation(len(x))[:SAMPLES_OF_LIKELIHOOD]
    scaled = (x - center) * rates
    found = _lengths(scaled[chosen], (y[chosen] - mean) / spread, kinds)
    rates = rates * found.rates
    return _in_units(
        _solved(x, (y - mean) / spread, center, rates, found, count),
        mean,
        spread,
        known,
    )


@dataclass(frozen=True)
class _Found:
    """What the likelihood says: rates of scaled features, and variances of kernel, slopes and noise."""

    rates: np.ndarray
    kernel: float
    linear: float
    noise: float


def _lengths(x: np.ndarray, y: np.ndarray, kinds: np.ndarray) -> _Found:
    """Those under which the samples are likeliest, by gradient steps on logarithms."""
    begun = {
        "kinds": jnp.zeros(kinds.shape[1]),
        "all": jnp.asarray(-0.5 * np.log(max(1, int(np.count_nonzero(x.std(axis=0)))))),
        "kernel": jnp.zeros(()),
        "linear": jnp.asarray(2.0 * np.log(FIRST_LINEAR)),
        "noise": jnp.asarray(np.log(FIRST_NOISE)),
    }
    optimizer = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, STEPS))
    best = _likeliest(
        begun, *(jnp.asarray(part, jnp.float32) for part in (x, y, kinds)), optimizer
    )
    rates = np.exp(np.asarray(best["all"] + kinds @ best["kinds"], np.float64))
    kernel, linear, noise = (
        float(jnp.exp(best[name])) for name in ("kernel", "linear", "noise")
    )
    return _Found(rates, kernel, linear, noise + MIN_NOISE)


@partial(jax.jit, static_argnums=4)
def _likeliest(begun: dict, x: Array, y: Array, kinds: Array, optimizer: Any) -> dict:
    def step(carry, _):
        numbers, state = carry
        gradient = jax.grad(_unlikelihood)(numbers, x, y, kinds)
        updates, state = optimizer.update(gradient, state)
        return (optax.apply_updates(numbers, updates), state), None

    return jax.lax.scan(step, (begun, optimizer.init(begun)), None, STEPS)[0][0]


def _unlikelihood(numbers: dict, x: Array, y: Array, kinds: Array) -> Array:
    """Minus the logarithm of the likelihood of the samples, per sample and output."""
    place = x * jnp.exp(numbers["all"] + kinds @ numbers["kinds"])
    covariance = (
        jnp.exp(numbers["kernel"]) * matern(place, place)
        + jnp.exp(numbers["linear"]) * x @ x.T
    )
    noise = jnp.exp(numbers["noise"]) + MIN_NOISE
    root = jnp.linalg.cholesky(covariance + (noise + 1e-5) * jnp.eye(len(x)))
    explained = jax.scipy.linalg.solve_triangular(root, y, lower=True)
    return jnp.sum(explained**2) / (2.0 * y.size) + jnp.sum(
        jnp.log(jnp.diag(root))
    ) / len(x)


def _in_units(
    kernels: Kernels, mean: np.ndarray, spread: float, known: np.ndarray
) -> Kernels:
    """What was fitted to targets of mean zero and variance one, in their own units, zero where they are not known."""

    def put(values: Array, offset=0.0):
        full = np.zeros((*values.shape[:-1], len(known)), np.float32)
        full[..., np.flatnonzero(known)] = np.asarray(values) * spread + offset
        return jnp.asarray(full)

    parts = put(kernels.weights), put(kernels.slopes), put(kernels.constant, mean)
    return eqx.tree_at(lambda k: (k.weights, k.slopes, k.constant), kernels, parts)


def _solved(x, y, center, rates, found: _Found, count: int) -> Kernels:
    """Weights of evenly drawn points, and slopes, that all samples ask for."""
    place = (x - center) * rates
    points = place[np.unique(np.linspace(0, len(place) - 1, count).astype(int))]
    slope = np.sqrt(found.linear / found.kernel) / np.where(rates > 0, found.rates, 1.0)
    scale = np.where(rates > 0, slope, 0.0)
    prior = matern(points, points)
    basis = np.hstack([matern(place, points), place * scale])
    cost = np.zeros((basis.shape[1],) * 2)
    cost[: len(points), : len(points)] = prior
    cost[len(points) :, len(points) :] = np.eye(place.shape[1])
    ratio = found.noise / found.kernel
    weights = np.linalg.solve(
        basis.T @ basis + ratio * cost + 1e-9 * np.eye(len(cost)), basis.T @ y
    )
    padded = np.zeros((count, x.shape[1]))
    padded[: len(points)] = points
    kernel_weights = np.zeros((count, y.shape[1]))
    kernel_weights[: len(points)] = weights[: len(points)]
    slopes = scale[:, None] * weights[len(points) :]
    numbers = center, rates, padded, kernel_weights, slopes, np.zeros(y.shape[1]), 1.0
    return Kernels(*(jnp.asarray(part, jnp.float32) for part in numbers))
