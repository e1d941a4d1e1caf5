"""Gaussian process regression with a Matern kernel on inducing points.

Each feature has its own length scale. A fixed number of inducing points stands for all
samples (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, secs. 4.2,
5.4 and 8.3.3: subset of regressors). Hyperparameters maximize the likelihood of a subset
of the samples. `Kernels.support` is one near the data and zero far from them, so that a
model can fade the regression out.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import Numbers
from s2c2a.training.fit import Fixed

LIKELIHOOD_SAMPLES = 700
STEPS = 60  # of Adam, on logarithms
LEARNING_RATE = 0.1
MIN_NOISE = 1e-4  # of the targets' variance
INITIAL_LINEAR = 0.05  # prior standard deviation of the slopes
INITIAL_NOISE = 0.01
MIN_SAMPLES = 100
SUPPORTED_SHARE = 0.9  # of held-out samples near the data, with full support
MIN_CLOSENESS = 1e-3  # least closeness of full support, if held-out samples are far


class Kernels(Fixed):
    """A fitted regression: kernel, linear part and constant.

    Attributes:
        center: of the features, shape (features,).
        rates: inverse length scale of each feature; zero if it is not used, shape
            (features,).
        points: inducing points in scaled features, shape (points, features).
        weights: of the kernel at each point, shape (points, outputs).
        slopes: of the linear part in scaled features, shape (features, outputs).
        constant: shape (outputs,).
        is_fitted: one if the model is fitted, else zero, shape ().
        usual_closeness: closeness that most held-out samples exceed, shape ().
    """

    center: Float[Array, " features"]
    rates: Float[Array, " features"]
    points: Float[Array, "points features"]
    weights: Float[Array, "points outputs"]
    slopes: Float[Array, "features outputs"]
    constant: Float[Array, " outputs"]
    is_fitted: Float[Array, ""]
    usual_closeness: Float[Array, ""]

    @classmethod
    def unfitted(cls, features: int, outputs: int, points: int) -> "Kernels":
        """A model that is not fitted; its output is zero."""
        return cls(
            center=jnp.zeros(features),
            rates=jnp.zeros(features),
            points=jnp.zeros((points, features)),
            weights=jnp.zeros((points, outputs)),
            slopes=jnp.zeros((features, outputs)),
            constant=jnp.zeros(outputs),
            is_fitted=jnp.zeros(()),
            usual_closeness=jnp.ones(()),
        )

    def times(self, weight: float) -> "Kernels":
        """The model with its output multiplied by a weight."""
        return replace(
            self,
            weights=weight * self.weights,
            slopes=weight * self.slopes,
            constant=weight * self.constant,
        )

    def scaled(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch features"]:
        """Features in units of the length scales, about their center."""
        return (features - self.center) * self.rates

    def __call__(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch outputs"]:
        """Predictions, shape (*batch, outputs)."""
        scaled = self.scaled(features)
        local = matern(scaled, self.points) @ self.weights
        return local + scaled @ self.slopes + self.constant

    def closeness(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """Kernel value at the nearest point: one at a point, zero far from all."""
        return jnp.max(matern(self.scaled(features), self.points), axis=-1)

    def support(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """Share of the regression that the data support: one near them, zero far away."""
        relative = self.closeness(features) / self.usual_closeness
        return jnp.minimum(relative, 1.0) * self.is_fitted

    def with_usual_closeness(
        self, held_out: Float[np.ndarray, "samples features"]
    ) -> "Kernels":
        """The model that is supported at most of these samples."""
        closeness = self.closeness(jnp.asarray(held_out, jnp.float32))
        usual = jnp.quantile(closeness, 1.0 - SUPPORTED_SHARE)
        return replace(self, usual_closeness=jnp.maximum(usual, MIN_CLOSENESS))


def matern(
    features: Float[Numbers, "*batch features"],
    points: Float[Numbers, "points features"],
):
    """Matern kernel of order 5/2: (1 + d + d^2 / 3) exp(-d), d = sqrt(5) |x - z|.

    The gradient at zero distance is zero. Inputs and result are both NumPy or both JAX.

    Returns:
        Kernel values, shape (*batch, points).
    """
    xp = points.__array_namespace__()
    squared_features = xp.sum(features**2, axis=-1)[..., None]
    squared_points = xp.sum(points**2, axis=-1)
    squared = squared_features + squared_points - 2.0 * features @ points.T
    distance = xp.sqrt(5.0 * xp.maximum(squared, 1e-9))
    return (1.0 + distance + distance**2 / 3.0) * xp.exp(-distance)


def _inverse_widths(
    features: Float[np.ndarray, "samples features"],
) -> Float[np.ndarray, " features"]:
    """Inverse standard deviation of each feature; zero if it is constant."""
    width = features.std(axis=0)
    return np.where(width > 1e-6, 1.0 / np.maximum(width, 1e-6), 0.0)


def fit_kernels(
    features: Float[np.ndarray, "samples features"],
    targets: Float[np.ndarray, "samples outputs"],
    kinds: Float[np.ndarray, "features kinds"],
    count: int,
) -> Kernels:
    """Fit a regression on inducing points to samples; unknown outputs are zero.

    Args:
        features: of samples, in order of time.
        targets: of samples, in comparable units; NaN: unknown.
        kinds: groups of features that share a factor of their length scales: one if a
            feature is in a group, else zero.
        count: number of inducing points.

    Returns:
        The fitted model; with fewer than `MIN_SAMPLES` samples, one that is not fitted.
    """
    known = np.isfinite(targets).any(axis=0)
    has_targets = np.isfinite(targets[:, known]).all(axis=1)
    complete = has_targets & np.isfinite(features).all(axis=1)
    if complete.sum() < MIN_SAMPLES or not known.any():
        return Kernels.unfitted(features.shape[1], targets.shape[1], count)
    x = features[complete].astype(np.float64)
    y = targets[complete][:, known].astype(np.float64)
    center = x.mean(axis=0)
    rates = _inverse_widths(x)
    mean = y.mean(axis=0)
    scale = max(float(np.sqrt(((y - mean) ** 2).mean())), 1e-9)
    scaled = (x - center) * rates
    normalized = (y - mean) / scale
    subset = np.random.default_rng(0).permutation(len(x))[:LIKELIHOOD_SAMPLES]
    fitted = _fit_hyperparameters(scaled[subset], normalized[subset], kinds)
    kernels = _solve_weights(x, normalized, center, rates * fitted.rates, fitted, count)
    return _denormalize(kernels, mean, scale, known)


@dataclass(frozen=True)
class _Hyperparameters:
    """Rates of scaled features, and variances of kernel, slopes and noise."""

    rates: np.ndarray
    kernel: float
    linear: float
    noise: float


def _fit_hyperparameters(
    x: np.ndarray, y: np.ndarray, kinds: np.ndarray
) -> _Hyperparameters:
    """Maximize the likelihood of samples by gradient steps on logarithms."""
    varying = max(1, int(np.count_nonzero(x.std(axis=0))))
    initial = {
        "kinds": jnp.zeros(kinds.shape[1]),
        "all": jnp.asarray(-0.5 * np.log(varying)),
        "kernel": jnp.zeros(()),
        "linear": jnp.asarray(2.0 * np.log(INITIAL_LINEAR)),
        "noise": jnp.asarray(np.log(INITIAL_NOISE)),
    }
    arrays = [jnp.asarray(array, jnp.float32) for array in (x, y, kinds)]
    best = _maximize_likelihood(initial, *arrays)
    rates = np.exp(np.asarray(best["all"] + kinds @ best["kinds"], np.float64))
    noise = float(jnp.exp(best["noise"])) + MIN_NOISE
    kernel = float(jnp.exp(best["kernel"]))
    return _Hyperparameters(rates, kernel, float(jnp.exp(best["linear"])), noise)


@jax.jit
def _maximize_likelihood(initial: dict, x: Array, y: Array, kinds: Array) -> dict:
    # made here: as an argument, each new optimizer would be another program
    optimizer = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, STEPS))

    def step(carry, _):
        logarithms, state = carry
        gradient = jax.grad(_negative_log_likelihood)(logarithms, x, y, kinds)
        updates, state = optimizer.update(gradient, state)
        return (optax.apply_updates(logarithms, updates), state), None

    carry = initial, optimizer.init(initial)
    return jax.lax.scan(step, carry, None, STEPS)[0][0]


def _negative_log_likelihood(
    logarithms: dict, x: Array, y: Array, kinds: Array
) -> Array:
    """Per sample and output."""
    scaled = x * jnp.exp(logarithms["all"] + kinds @ logarithms["kinds"])
    local = jnp.exp(logarithms["kernel"]) * matern(scaled, scaled)
    covariance = local + jnp.exp(logarithms["linear"]) * x @ x.T
    noise = jnp.exp(logarithms["noise"]) + MIN_NOISE
    root = jnp.linalg.cholesky(covariance + (noise + 1e-5) * jnp.eye(len(x)))
    whitened = jax.scipy.linalg.solve_triangular(root, y, lower=True)
    misfit = jnp.sum(whitened**2) / (2.0 * y.size)
    return misfit + jnp.sum(jnp.log(jnp.diag(root))) / len(x)


def _denormalize(
    kernels: Kernels, mean: np.ndarray, scale: float, known: np.ndarray
) -> Kernels:
    """The fit to normalized targets in their own units; unknown outputs are zero."""

    def expand(values: Array, offset=0.0):
        full = np.zeros((*values.shape[:-1], len(known)), np.float32)
        full[..., np.flatnonzero(known)] = np.asarray(values) * scale + offset
        return jnp.asarray(full)

    return replace(
        kernels,
        weights=expand(kernels.weights),
        slopes=expand(kernels.slopes),
        constant=expand(kernels.constant, mean),
    )


def _solve_weights(
    x: Float[np.ndarray, "complete features"],
    y: Float[np.ndarray, "complete known"],
    center: Float[np.ndarray, " features"],
    rates: Float[np.ndarray, " features"],
    fitted: _Hyperparameters,
    count: int,
) -> Kernels:
    """Weights of evenly spaced inducing points and slopes, fitted to all samples."""
    features = (x - center) * rates
    numbers = np.unique(np.linspace(0, len(features) - 1, count).astype(int))
    points = features[numbers]
    used = len(points)
    ratio = np.sqrt(fitted.linear / fitted.kernel)
    slope_scale = ratio / np.where(rates > 0, fitted.rates, 1.0)
    slope_scale = np.where(rates > 0, slope_scale, 0.0)
    basis = np.hstack([matern(features, points), features * slope_scale])
    prior = np.zeros((basis.shape[1],) * 2)
    prior[:used, :used] = matern(points, points)
    prior[used:, used:] = np.eye(features.shape[1])
    noise = fitted.noise / fitted.kernel
    normal = basis.T @ basis + noise * prior + 1e-9 * np.eye(len(prior))
    solution = np.linalg.solve(normal, basis.T @ y)
    padding = ((0, count - used), (0, 0))
    slopes = slope_scale[:, None] * solution[used:]
    return Kernels(
        center=jnp.asarray(center, jnp.float32),
        rates=jnp.asarray(rates, jnp.float32),
        points=jnp.asarray(np.pad(points, padding, mode="edge"), jnp.float32),
        weights=jnp.asarray(np.pad(solution[:used], padding), jnp.float32),
        slopes=jnp.asarray(slopes, jnp.float32),
        constant=jnp.zeros(y.shape[1]),
        is_fitted=jnp.ones(()),
        usual_closeness=jnp.ones(()),
    )
