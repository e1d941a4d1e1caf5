"""Region of the training data of a forward model, and its deviation beyond that region.

A Gaussian process with long length scales measures the distance from the data: its
posterior variance, relative to the prior. There the structure of a model is unproved, so
that its prediction may be wrong by `PRIOR_STD`.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.models.arrays import FeatureRows
from s2c2a.models.residual_process import Features, PerFeature, matern, precisions
from s2c2a.training.fit import Fixed

LENGTH = 4.0  # of the kernel, in standard deviations of each feature
NOISE = 0.01  # variance of samples, relative to the kernel's
INTERPOLATION_SHARE = 0.95  # of validation samples that count as interpolation
MAX_INTERPOLATION_VARIANCE = 0.9  # relative; the rest is the range of extrapolation
MIN_WIDTH = 0.1  # of the widest feature; a constant feature is known at one value only
PRIOR_STD = 0.1
"""Of an end's distance from the base: deviation far from all data.

Chains err by 0.09 to 0.14 of it there, on regions that were left out of the data of two
presets and six randomized arms.
"""


class DataRegion(Fixed):
    """Distance from the data.

    Attributes:
        center: of the features, shape (features,).
        rates: inverse length scale of each feature, shape (features,).
        points: inducing points in scaled features, shape (points, features).
        root: R, where R R' is the precision that the samples add at the points, shape
            (points, points).
        usual: largest relative variance that counts as interpolation, shape ().
    """

    center: PerFeature
    rates: PerFeature
    points: Float[Array, "points features"]
    root: Float[Array, "points points"]
    usual: Float[Array, ""]

    @classmethod
    def everywhere(cls, features: int, points: int) -> "DataRegion":
        """The region of a model that does not extrapolate, such as one without data."""
        return cls(
            center=jnp.zeros(features),
            rates=jnp.zeros(features),
            points=jnp.zeros((points, features)),
            root=jnp.zeros((points, points)),
            usual=jnp.ones(()),
        )

    def extrapolation(self, features: Features) -> Float[Array, "*batch"]:
        """From zero near the data to one far from them."""
        excess = self.relative_variance(features) - self.usual
        return jnp.maximum(excess, 0.0) / jnp.maximum(1.0 - self.usual, 1e-6)

    def relative_variance(self, features: Features) -> Float[Array, "*batch"]:
        """Posterior variance over prior variance, from 0 to 1."""
        kernel = matern((features - self.center) * self.rates, self.points)
        explained = jnp.sum((kernel @ self.root) ** 2, axis=-1)
        return jnp.clip(1.0 - explained, 0.0, 1.0)


def fit_region(
    features: FeatureRows, held_out: Float[np.ndarray, "others features"], points: int
) -> DataRegion:
    """The region of these data.

    Args:
        features: of training samples, in order of time.
        held_out: features of validation samples.
        points: number of inducing points.
    """
    center = features.mean(axis=0)
    width = features.std(axis=0)
    min_width = max(MIN_WIDTH * float(width.max()), 1e-6)
    rates = 1.0 / (LENGTH * np.maximum(width, min_width))
    scaled = (features - center).astype(np.float64) * rates
    inducing = scaled[np.linspace(0, len(scaled) - 1, points).astype(int)]
    root, *_ = precisions(scaled, inducing, NOISE)
    region = DataRegion(
        center=jnp.asarray(center, jnp.float32),
        rates=jnp.asarray(rates, jnp.float32),
        points=jnp.asarray(inducing, jnp.float32),
        root=jnp.asarray(root, jnp.float32),
        usual=jnp.zeros(()),
    )
    variances = region.relative_variance(jnp.asarray(held_out, jnp.float32))
    usual = jnp.quantile(variances, INTERPOLATION_SHARE)
    return replace(region, usual=jnp.minimum(usual, MAX_INTERPOLATION_VARIANCE))
