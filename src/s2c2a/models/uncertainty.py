"""How far off a model must be expected to be: as far as it was on data held out, and further where there were none.

What is known at a place is told by a kernel and few points (`kernels.matern`; Rasmussen
and Williams, Gaussian Processes for Machine Learning, 2006, sec. 8.3): of all that
could be there, the share that the data leave open. As much as was left open at places
held out is nothing strange; beyond that, doubt grows until nothing is known.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.models.kernels import matern
from s2c2a.training.fit import Fixed

LENGTH = 4.0  # of the kernel, in standard deviations of each feature
# beside the kernel's variance: of samples, and of points
NOISE = 0.01
JITTER = 1e-4
USUAL = 0.95  # share of the places held out that are nothing strange
# of a feature, in parts of the widest: where nothing was moved, nothing is known
MIN_WIDTH = 0.1
IGNORANCE = 0.3  # of the arm's length: how far off it may be where nothing is known


class Known(Fixed):
    """What was known, and how far off a model was there.

    Attributes:
        center: of the features, shape (features,).
        rates: one over the length of each, shape (features,).
        points: centered and scaled, shape (points, features).
        root: of the inverse of the kernel less that of kernel and data, shape (points,
            points).
        usual: share left open that is nothing strange.
        usual_error: root of the mean square distance there [m], shape (modules,).
        ignorance: where nothing is known [m].
    """

    center: Float[Array, " features"]
    rates: Float[Array, " features"]
    points: Float[Array, "points features"]
    root: Float[Array, "points points"]
    usual: Float[Array, ""]
    usual_error: Float[Array, " modules"]
    ignorance: Float[Array, ""]

    @classmethod
    def none(cls, features: int, points: int, modules: int) -> "Known":
        """Of a model that was never tried."""
        shapes = (
            (features,),
            (features,),
            (points, features),
            (points, points),
            (),
            (modules,),
            (),
        )
        return cls(*map(jnp.zeros, shapes))

    def strangeness(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """From zero where the data were to one where nothing is known."""
        return jnp.maximum(self.left_open(features) - self.usual, 0.0) / (
            1.0 - self.usual
        )

    def left_open(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """Share of what could be there that the data do not tell."""
        near = matern((features - self.center) * self.rates, self.points)
        return jnp.clip(1.0 - jnp.sum((near @ self.root) ** 2, axis=-1), 0.0, 1.0)

    def meters(
        self, features: Float[Array, "*batch features"]
    ) -> Float[Array, "*batch"]:
        """How much further off than usual an end may be [m]."""
        return self.ignorance * self.strangeness(features) ** 2


def known_from(
    features: Float[np.ndarray, "samples features"],
    held_out: Float[np.ndarray, "others features"],
    distances: Float[np.ndarray, "others modules"],
    points: int,
    length: float,
) -> Known:
    """What data tell.

    Args:
        features: of samples learned from, in order of time.
        held_out: of others.
        distances: of ends there from where a model said they would be [m]; NaN where
            not known.
        points: that stand for all.
        length: of the arm [m].
    """
    center = features.mean(axis=0)
    width = features.std(axis=0)
    rates = 1.0 / (
        LENGTH * np.maximum(width, max(MIN_WIDTH * float(width.max()), 1e-6))
    )
    place = (features - center).astype(np.float64) * rates
    chosen = place[np.linspace(0, len(place) - 1, points).astype(int)]
    prior = matern(chosen, chosen) + JITTER * np.eye(points)
    seen = matern(place, chosen)
    values, vectors = np.linalg.eigh(
        np.linalg.inv(prior) - np.linalg.inv(prior + seen.T @ seen / NOISE)
    )
    # its square would lose what single precision cannot hold
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    squares = np.sum(distances**2, axis=0, where=np.isfinite(distances))
    error = np.sqrt(squares / np.maximum(np.isfinite(distances).sum(axis=0), 1))
    numbers = center, rates, chosen, root, 0.0, error, IGNORANCE * length
    known = Known(*(jnp.asarray(part, jnp.float32) for part in numbers))
    usual = jnp.quantile(known.left_open(jnp.asarray(held_out, jnp.float32)), USUAL)
    return eqx.tree_at(lambda told: told.usual, known, jnp.minimum(usual, 0.9))
