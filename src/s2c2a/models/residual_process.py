"""Gaussian process of a model's residual, with a Matern kernel on inducing points.

Each feature has its own length scale. A fixed number of inducing points stands for all
samples (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, secs. 4.2,
5.4 and 8.3.3: subset of regressors). The mean is zero far from the data, and the standard
deviation is then that of the residual.

Samples of a recording are alike if they follow each other, since an arm vibrates and
creeps: to a likelihood of all of them, the process would look exact, and it would be
rough. So hyperparameters maximize the likelihood of samples that are far apart in time,
and the motion of a second, for which a plan is made, is no longer than the length scale.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import Numbers, Scalar, Truth
from s2c2a.models.arrays import FeatureRows, OutputRows
from s2c2a.training.fit import Fixed

Features = Float[Array, "*batch features"]
PerFeature = Float[Array, " features"]
PerOutput = Float[Array, " outputs"]
Kinds = Float[Array, "features kinds"]
GAP = 25  # samples over which residuals of recorded arms are correlated
SUBSET = 100
"""Samples that hyperparameters need at least; short recordings have a smaller gap."""
LARGEST_SUBSET = 250
"""Samples of a subset at most: with 400, errors of six recordings were the same."""
SUBSETS = 10  # of which the mean likelihood counts; their programs take a second
STEPS = 60  # of Adam, on logarithms; further ones change no error
LEARNING_RATE = 0.1  # a tenth of a factor e in a step
JITTER = 1e-4
"""Variance of inducing points, relative to the kernel's: single precision needs it."""


class ResidualProcess(Fixed):
    """A fitted process.

    Attributes:
        center: of the features, shape (features,).
        rates: inverse length scale of each feature; zero if it is not used, shape
            (features,).
        points: inducing points in scaled features, shape (points, features).
        weights: of the kernel at each point, shape (points, outputs).
        root: R, where R R' is the precision that the samples add at the points, shape
            (points, points).
        constant: mean far from the data, shape (outputs,).
        amplitude: prior variance of the process over that of the outputs, shape ().
        noise: variance of samples over that of the outputs, shape ().
        scale: standard deviation of each output, shape (outputs,).
    """

    center: PerFeature
    rates: PerFeature
    points: Float[Array, "points features"]
    weights: Float[Array, "points outputs"]
    root: Float[Array, "points points"]
    constant: PerOutput
    amplitude: Scalar
    noise: Scalar
    scale: PerOutput

    @classmethod
    def none(cls, features: int, outputs: int, points: int) -> "ResidualProcess":
        """A process without samples: zero, without deviation."""
        return cls(
            center=jnp.zeros(features),
            rates=jnp.zeros(features),
            points=jnp.zeros((points, features)),
            weights=jnp.zeros((points, outputs)),
            root=jnp.zeros((points, points)),
            constant=jnp.zeros(outputs),
            amplitude=jnp.zeros(()),
            noise=jnp.ones(()),
            scale=jnp.zeros(outputs),
        )

    @property
    def is_fitted(self) -> Truth:
        """Whether the process has samples."""
        return self.amplitude > 0.0

    def __call__(self, features: Features) -> Float[Array, "*batch outputs"]:
        """Means, shape (*batch, outputs)."""
        return self._kernel(features) @ self.weights + self.constant

    def variance(self, features: Features) -> Float[Array, "*batch"]:
        """Variance of the mean over that of the outputs: small near the samples."""
        explained = jnp.sum((self._kernel(features) @ self.root) ** 2, axis=-1)
        return self.amplitude * jnp.clip(1.0 - explained, 0.0, 1.0)

    def _kernel(self, features: Features) -> Float[Array, "*batch points"]:
        return matern((features - self.center) * self.rates, self.points)

    def given(self, features: FeatureRows, targets: OutputRows) -> "ResidualProcess":
        """The process with these samples alone; its hyperparameters stay.

        Args:
            features: of samples, in order of time.
            targets: residuals in the units of the outputs; those of outputs that the
                process does not know are ignored.
        """
        if not self.is_fitted:
            return self
        known = np.asarray(self.scale) > 0.0
        complete = np.isfinite(targets[:, known]).all(axis=1)
        complete &= np.isfinite(features).all(axis=1)
        y = targets[complete][:, known].astype(np.float64)
        mean = y.mean(axis=0)
        scale = np.asarray(self.scale, np.float64)[known]
        scaled = (features[complete] - np.asarray(self.center)) * np.asarray(self.rates)
        noise = float(self.noise / self.amplitude)
        # evenly spaced in time
        rows = np.linspace(0, len(scaled) - 1, len(self.points)).astype(int)
        points = scaled[rows]
        root, posterior, kernel = precisions(scaled, points, noise)
        normalized = (y - mean) / scale
        weights = np.linalg.solve(posterior, kernel.T @ normalized / noise)

        def for_all_outputs(values: np.ndarray) -> Array:
            outputs = np.zeros((*values.shape[:-1], len(known)), np.float32)
            outputs[..., known] = values
            return jnp.asarray(outputs)

        return replace(
            self,
            points=jnp.asarray(points, jnp.float32),
            weights=for_all_outputs(weights * scale),
            root=jnp.asarray(root, jnp.float32),
            constant=for_all_outputs(mean),
        )

    def deviations(self, features: FeatureRows) -> Float[np.ndarray, " samples"]:
        """Deviation of samples over that of the outputs, with their noise."""
        variances = self.variance(jnp.asarray(features, jnp.float32)) + self.noise
        return np.sqrt(np.asarray(variances))


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


def fit_process(
    features: FeatureRows,
    targets: OutputRows,
    kinds: Float[np.ndarray, "features kinds"],
    motion: Float[np.ndarray, " features"],
    points: int,
) -> ResidualProcess:
    """Fit a process to samples.

    Args:
        features: of samples, in order of time.
        targets: residuals, in comparable units; NaN: unknown.
        kinds: groups of features that share a factor of their length scales: one if a
            feature is in a group, else zero.
        motion: root mean square change of the features in a second.
        points: number of inducing points.

    Returns:
        The process; one without samples if fewer than `SUBSET` are known. Unknown
        outputs are zero.
    """
    known = np.isfinite(targets).any(axis=0)
    has_targets = np.isfinite(targets[:, known]).all(axis=1)
    complete = has_targets & np.isfinite(features).all(axis=1)
    if complete.sum() < SUBSET or not known.any():
        return ResidualProcess.none(features.shape[1], targets.shape[1], points)
    x = features[complete].astype(np.float64)
    y = targets[complete][:, known].astype(np.float64)
    center = x.mean(axis=0)
    # inverse standard deviation of each feature; zero if it is constant
    width = x.std(axis=0)
    rates = np.where(width > 1e-6, 1.0 / np.maximum(width, 1e-6), 0.0)
    mean = y.mean(axis=0)
    scale = np.maximum(y.std(axis=0), 1e-9)
    subsets = _subsets(len(x), np.random.default_rng(0))
    inputs = [
        ((x - center) * rates)[subsets],
        ((y - mean) / scale)[subsets],
        kinds,
        motion * rates,
    ]
    inputs = [jnp.asarray(each, jnp.float32) for each in inputs]
    # logarithms of the hyperparameters at first; half of the variance is noise
    initial = {
        "kinds": jnp.zeros(kinds.shape[1]),
        "all": -0.5 * jnp.log(max(1, int((rates > 0.0).sum()))),
        "kernel": jnp.log(0.5),
        "noise": jnp.log(0.5),
    }
    fitted = _maximize(initial, *inputs)
    all_scales = np.zeros(len(known))
    all_scales[known] = scale
    process = replace(
        ResidualProcess.none(features.shape[1], targets.shape[1], points),
        center=jnp.asarray(center, jnp.float32),
        rates=jnp.asarray(rates, jnp.float32) * _rates(fitted, *inputs[2:]),
        amplitude=jnp.exp(fitted["kernel"]),
        noise=jnp.exp(fitted["noise"]),
        scale=jnp.asarray(all_scales, jnp.float32),
    )
    return process.given(features, targets)


def _subsets(samples: int, random: np.random.Generator) -> np.ndarray:
    """Numbers of samples with gaps of time between them, shape (subsets, size)."""
    gap = max(1, min(GAP, samples // SUBSET))
    size = min(samples // gap, LARGEST_SUBSET)
    offsets = random.permutation(gap)[:SUBSETS]
    rows = [np.arange(offset, samples, gap) for offset in offsets]
    return np.array([np.sort(random.permutation(each)[:size]) for each in rows])


def _rates(
    logarithms: dict[str, Array], kinds: Kinds, motion: PerFeature
) -> PerFeature:
    """Inverse length scales of normalized features, for which the motion is short."""
    rates = jnp.exp(logarithms["all"] + kinds @ logarithms["kinds"])
    squared = jnp.sum((rates * motion) ** 2)
    # the slope of a root is infinite at zero
    return rates / jnp.sqrt(jnp.maximum(1.0, squared))


@jax.jit
def _maximize(
    initial: dict,
    x: Float[Array, "subsets size features"],
    y: Float[Array, "subsets size outputs"],
    kinds: Kinds,
    motion: PerFeature,
) -> dict:
    """Logarithms of the hyperparameters that maximize the mean likelihood."""
    # made here: as an argument, each new optimizer would be another program
    optimizer = optax.adam(optax.cosine_decay_schedule(LEARNING_RATE, STEPS))

    def loss(logarithms: dict) -> Array:
        scaled = x * _rates(logarithms, kinds, motion)
        each = jax.vmap(lambda x, y: _negative_log_likelihood(logarithms, x, y))
        # each factor is log-normal, with a deviation of one
        prior = jnp.sum(logarithms["kinds"] ** 2) / (2.0 * y[0].size)
        return jnp.mean(each(scaled, y)) + prior

    def step(carry, _):
        logarithms, state = carry
        updates, state = optimizer.update(jax.grad(loss)(logarithms), state)
        return (optax.apply_updates(logarithms, updates), state), None

    carry = initial, optimizer.init(initial)
    return jax.lax.scan(step, carry, None, STEPS)[0][0]


def _negative_log_likelihood(
    logarithms: dict, scaled: Float[Array, "size features"], y: Array
) -> Array:
    """Per sample and output."""
    noise = jnp.exp(logarithms["noise"]) + JITTER
    covariance = jnp.exp(logarithms["kernel"]) * matern(scaled, scaled)
    root = jnp.linalg.cholesky(covariance + noise * jnp.eye(len(y)))
    whitened = jax.scipy.linalg.solve_triangular(root, y, lower=True)
    misfit = jnp.sum(whitened**2) / (2.0 * y.size)
    return misfit + jnp.sum(jnp.log(jnp.diag(root))) / len(y)


def precisions(
    samples: FeatureRows, points: Float[np.ndarray, "points features"], noise: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What samples tell at inducing points, of a process with a kernel of variance one.

    Args:
        samples: scaled features.
        points: scaled features of the inducing points.
        noise: variance of a sample.

    Returns:
        R, where R R' is the precision that the samples add at the points, shape (points,
        points): the posterior variance at a kernel k is 1 - |k R|^2, and the square
        itself would exceed single precision; the kernel of the points with the samples,
        same shape; and that from samples to points.
    """
    prior = _single_matern(points, points) + JITTER * np.eye(len(points))
    kernel = _single_matern(samples, points)
    posterior = prior + kernel.T @ kernel / noise
    added = np.linalg.inv(prior) - np.linalg.inv(posterior)
    values, vectors = np.linalg.eigh(added)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return root, posterior, kernel


def _single_matern(x: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The kernel as it is used later: rounded to single precision."""
    return matern(x.astype(np.float32), points.astype(np.float32)).astype(np.float64)
