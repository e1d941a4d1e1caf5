"""Uncertainty of a forward model: more on fast motion and in extrapolation.

The posterior variance of a Gaussian process on inducing points (`kernels.matern`;
Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, sec. 8.3),
relative to its prior variance, measures the distance from the data. Variances up to
those of most validation samples count as interpolation. The standard deviation of an end
is

    sqrt(interpolation^2 + (speed error * speed)^2 + (extrapolation error * extrapolation)^2)

with errors that `models.calibration` fits to data that a model has not seen.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.models.kernels import matern
from s2c2a.training.fit import Fixed

LENGTH = 4.0  # of the kernel, in standard deviations of each feature
NOISE = 0.01  # variance of samples, relative to the kernel's
JITTER = 1e-4  # variance of inducing points, relative to the kernel's
INTERPOLATION_SHARE = 0.95  # of validation samples that count as interpolation
MAX_INTERPOLATION_VARIANCE = 0.9  # relative; the rest is the range of extrapolation
MIN_WIDTH = 0.1  # of the widest feature; a constant feature is known at one value only
PRIOR_STD = 0.3  # of the arm's length: error of the tip far from all data, uncalibrated


class Uncertainty(Fixed):
    """Distance from the data, and the error of a model near them.

    Attributes:
        center: of the features, shape (features,).
        rates: inverse length scale of each feature, shape (features,).
        points: inducing points in scaled features, shape (points, features).
        root: square root of inv(K) - inv(K + data), shape (points, points).
        interpolation_variance: largest relative posterior variance that counts as
            interpolation.
        interpolation_error: of slow motion near the data [m], shape (modules,).
        speed_error: per speed [m per rad in a control step], shape (modules,).
        extrapolation_error: far from all data [m], shape (modules,).
    """

    center: Float[Array, " features"]
    rates: Float[Array, " features"]
    points: Float[Array, "points features"]
    root: Float[Array, "points points"]
    interpolation_variance: Float[Array, ""]
    interpolation_error: Float[Array, " modules"]
    speed_error: Float[Array, " modules"]
    extrapolation_error: Float[Array, " modules"]

    @classmethod
    def none(cls, features: int, points: int, modules: int) -> "Uncertainty":
        """The uncertainty of a model without data: zero."""
        return cls(
            center=jnp.zeros(features),
            rates=jnp.zeros(features),
            points=jnp.zeros((points, features)),
            root=jnp.zeros((points, points)),
            interpolation_variance=jnp.zeros(()),
            interpolation_error=jnp.zeros(modules),
            speed_error=jnp.zeros(modules),
            extrapolation_error=jnp.zeros(modules),
        )

    def with_errors(
        self,
        interpolation: Float[np.ndarray, " modules"],
        speed: Float[np.ndarray, " modules"],
        extrapolation: Float[np.ndarray, " modules"],
    ) -> "Uncertainty":
        """The same distances from the data, with other errors.

        Args:
            interpolation: see `interpolation_error`.
            speed: see `speed_error`.
            extrapolation: see `extrapolation_error`.
        """
        return replace(
            self,
            interpolation_error=jnp.asarray(interpolation, jnp.float32),
            speed_error=jnp.asarray(speed, jnp.float32),
            extrapolation_error=jnp.asarray(extrapolation, jnp.float32),
        )

    def std(
        self, extrapolation: Float[Array, "*batch"], speed: Float[Array, "*batch"]
    ) -> Float[Array, "*batch modules"]:
        """Standard deviation of module ends [m].

        Args:
            extrapolation: from zero near the data to one.
            speed: root mean square over modules of the change of bends [rad per control
                step].
        """
        moving = self.speed_error * jnp.asarray(speed)[..., None]
        beyond = self.extrapolation_error * jnp.asarray(extrapolation)[..., None]
        return jnp.sqrt(self.interpolation_error**2 + moving**2 + beyond**2)

    def extrapolation(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """From zero near the data to one far from them."""
        excess = self.relative_variance(features) - self.interpolation_variance
        return jnp.maximum(excess, 0.0) / (1.0 - self.interpolation_variance)

    def relative_variance(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """Posterior variance over prior variance, from 0 to 1."""
        kernel = matern((features - self.center) * self.rates, self.points)
        explained = jnp.sum((kernel @ self.root) ** 2, axis=-1)
        return jnp.clip(1.0 - explained, 0.0, 1.0)

    def tip_extrapolation(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """Standard deviation of the tip that is due to extrapolation [m]."""
        return self.extrapolation_error[-1] * self.extrapolation(features)


def fit_uncertainty(
    features: Float[np.ndarray, "samples features"],
    held_out: Float[np.ndarray, "others features"],
    distances: Float[np.ndarray, "others modules"],
    points: int,
    length: float,
) -> Uncertainty:
    """The uncertainty of a model with these data, not calibrated.

    The error does not depend on the speed, and that of extrapolation is `PRIOR_STD`.

    Args:
        features: of training samples, in order of time.
        held_out: features of validation samples.
        distances: prediction errors of module ends there [m]; NaN where unknown.
        points: number of inducing points.
        length: of the arm [m].
    """
    center = features.mean(axis=0)
    width = features.std(axis=0)
    min_width = max(MIN_WIDTH * float(width.max()), 1e-6)
    rates = 1.0 / (LENGTH * np.maximum(width, min_width))
    scaled = (features - center).astype(np.float64) * rates
    inducing = scaled[np.linspace(0, len(scaled) - 1, points).astype(int)]
    error = _root_mean_square(distances)
    modules = len(error)
    uncertainty = Uncertainty(
        center=jnp.asarray(center, jnp.float32),
        rates=jnp.asarray(rates, jnp.float32),
        points=jnp.asarray(inducing, jnp.float32),
        root=jnp.asarray(_explained_root(scaled, inducing), jnp.float32),
        interpolation_variance=jnp.zeros(()),
        interpolation_error=jnp.asarray(error, jnp.float32),
        speed_error=jnp.zeros(modules),
        extrapolation_error=jnp.asarray(_uncalibrated(modules, length), jnp.float32),
    )
    variances = uncertainty.relative_variance(jnp.asarray(held_out, jnp.float32))
    usual = jnp.quantile(variances, INTERPOLATION_SHARE)
    largest = jnp.minimum(usual, MAX_INTERPOLATION_VARIANCE)
    return replace(uncertainty, interpolation_variance=largest)


def _explained_root(
    samples: Float[np.ndarray, "samples features"],
    inducing: Float[np.ndarray, "points features"],
) -> Float[np.ndarray, "points points"]:
    """Square root of inv(K) - inv(K + data), whose square exceeds single precision."""
    prior = matern(inducing, inducing) + JITTER * np.eye(len(inducing))
    kernel = matern(samples, inducing)
    posterior = prior + kernel.T @ kernel / NOISE
    values, vectors = np.linalg.eigh(np.linalg.inv(prior) - np.linalg.inv(posterior))
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _root_mean_square(
    distances: Float[np.ndarray, "samples modules"],
) -> Float[np.ndarray, " modules"]:
    """Root mean square of the known values; zero where all are NaN."""
    finite = np.isfinite(distances)
    squares = np.sum(distances**2, axis=0, where=finite)
    return np.sqrt(squares / np.maximum(finite.sum(axis=0), 1))


def _uncalibrated(modules: int, length: float) -> Float[np.ndarray, " modules"]:
    """Errors of module ends far from all data [m], which grow toward the tip."""
    return PRIOR_STD * length * np.arange(1, modules + 1) / modules
