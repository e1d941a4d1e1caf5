"""Bend biases as a function of the shape, learned while the arm runs and its tip is seen.

Each picture says which further bends explain it best. Part of them is due to a payload,
which bends the arm in its own way at every shape; the rest is a Gaussian process over
shape and time: pictures of like shapes agree, and less so the longer they are ago, so
that old ones are forgotten (S. Van Vaerenbergh, M. Lazaro-Gredilla and I. Santamaria,
Kernel recursive least-squares tracker for time-varying regression, IEEE Transactions on
Neural Networks and Learning Systems 23(8), 2012). The payload is a basis function of the
process with a prior of its own (Rasmussen and Williams, Gaussian Processes for Machine
Learning, 2006, sec. 2.7).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import FlatBends, Scalar

PICTURES = 256
"""Newest pictures that count; their covariance is factorized in half a millisecond."""
INTERVAL = 0.19
"""Least time between them [s]: at 5 Hz, 256 pictures are 51 s, three of the circles."""
MEMORY = 600.0  # s, of the biases: wear and creep take minutes
LENGTH = 0.8
"""Distance of shapes [rad] over which biases are alike.

Of 0.2, 0.4, 0.8 and 1.5, the best on circles of two randomized arms (strength 1.0).
"""
STD = 0.06  # rad; of biases: a tenth of a large bend
NOISE = 0.1
"""Standard deviation of what one picture says of the biases [rad].

It is that of vibration, not of the camera: successive pictures share theirs.
"""
NONE = 1e6  # s; age of a place without a picture, which thus counts nothing

PictureBends = Float[Array, "pictures bends"]


class Pictures(NamedTuple):
    """The newest pictures.

    Attributes:
        bends: sensed bends at which they were taken [rad], shape (pictures, bends).
        caused: bends by biases and payload that explain them [rad], shape (pictures,
            bends).
        by_payload: derivative of these bends by the payload [rad/kg], shape (pictures,
            bends).
        ages: time since they were taken [s], shape (pictures,).
    """

    bends: PictureBends
    caused: PictureBends
    by_payload: PictureBends
    ages: Float[Array, " pictures"]


class PayloadPrior(NamedTuple):
    """Normal distribution of the payload before any picture.

    Attributes:
        mean: [kg].
        std: [kg].
    """

    mean: float | Scalar
    std: float


class BiasField(NamedTuple):
    """Pictures so far, and the process fitted to them.

    Attributes:
        pictures: so far.
        weights: of the covariance with each of these [rad], shape (pictures, bends).
    """

    pictures: Pictures
    weights: PictureBends

    @classmethod
    def empty(cls, bends: int) -> "BiasField":
        """The field before the first picture: zero."""
        zeros = jnp.zeros((PICTURES, bends))
        return cls(Pictures(zeros, zeros, zeros, jnp.full(PICTURES, NONE)), zeros)

    def at(self, bends: FlatBends) -> FlatBends:
        """Expected bend biases at sensed bends [rad]."""
        known = self.pictures.bends, self.pictures.ages
        covariance = _covariance(bends[None], jnp.zeros(1), *known)
        return covariance[0] @ self.weights

    def aged(self, time: float) -> "BiasField":
        """The field after some time [s]."""
        ages = self.pictures.ages + time
        return self._replace(pictures=self.pictures._replace(ages=ages))

    def with_picture(
        self,
        bends: FlatBends,
        caused: FlatBends,
        by_payload: FlatBends,
        age: Scalar,
        prior: PayloadPrior,
    ) -> "BiasField":
        """The field with one more picture in place of the oldest.

        Args:
            bends: sensed when it was taken [rad].
            caused: bends by biases and payload that explain it [rad].
            by_payload: their derivative by the payload [rad/kg].
            age: time since it was taken [s].
            prior: of the payload.
        """
        oldest = jnp.argmax(self.pictures.ages)
        newest = Pictures(bends, caused, by_payload, age)
        pictures = jax.tree.map(
            lambda values, value: values.at[oldest].set(value), self.pictures, newest
        )
        return BiasField.fitted(pictures, prior)

    @classmethod
    def fitted(cls, pictures: Pictures, prior: PayloadPrior) -> "BiasField":
        """The field of pictures: generalized least squares for the payload."""
        bends, caused, by_payload, ages = pictures
        covariance = _covariance(bends, ages, bends, ages)
        noise = (NOISE / STD) ** 2 * jnp.eye(PICTURES)
        root = jnp.linalg.cholesky(covariance + noise)
        rest = caused - prior.mean * by_payload
        both = jnp.hstack([rest, by_payload])
        solved = jax.scipy.linalg.cho_solve((root, True), both)
        weights, base_weights = jnp.split(solved, 2, axis=-1)
        information = jnp.sum(by_payload * base_weights) + (STD / prior.std) ** 2
        payload = jnp.sum(by_payload * weights) / information
        weights = weights - payload * base_weights
        return cls(pictures, weights)


def _covariance(
    bends: Float[Array, "first bends"],
    ages: Float[Array, " first"],
    other_bends: Float[Array, "second bends"],
    other_ages: Float[Array, " second"],
) -> Float[Array, "first second"]:
    """Covariance of biases over their variance: of shapes, and of times."""
    squared = jnp.sum((bends[:, None] - other_bends) ** 2, axis=-1)
    apart = jnp.abs(ages[:, None] - other_ages)
    return jnp.exp(-squared / (2.0 * LENGTH**2) - apart / MEMORY)
