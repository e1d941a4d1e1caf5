"""Bend biases as a function of the shape, learned while the arm runs and its tip is seen.

Each picture says which further bends explain it best. Part of them is due to a payload,
which bends the arm in its own way at every shape; the rest is a Gaussian process over
shape and time: pictures of like shapes agree, and less so the longer they are ago, so
that old ones are forgotten (S. Van Vaerenbergh, M. Lazaro-Gredilla and I. Santamaria,
Kernel recursive least-squares tracker for time-varying regression, IEEE Transactions on
Neural Networks and Learning Systems 23(8), 2012). The payload is a basis function of the
process with a prior of its own (Rasmussen and Williams, Gaussian Processes for Machine
Learning, 2006, sec. 2.7). The newest pictures count.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

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
NOISE = 0.03
"""Standard deviation of the biases that one picture gives [rad].

It is that of vibration by 1 to 2 cm on an arm of 0.6 m, not of the camera.
"""
NONE = 1e6  # s; age of a place without a picture, which thus counts nothing


class BiasField(NamedTuple):
    """Pictures so far, and the process through them.

    Attributes:
        bends: sensed bends at which they were taken [rad], shape (pictures, bends).
        caused: bends by biases and payload that explain them [rad], shape (pictures,
            bends).
        by_payload: derivative of these bends by the payload [rad/kg], shape (pictures,
            bends).
        ages: time since they were taken [s], shape (pictures,).
        weights: of the covariance with each picture [rad], shape (pictures, bends).
    """

    bends: Float[Array, "pictures bends"]
    caused: Float[Array, "pictures bends"]
    by_payload: Float[Array, "pictures bends"]
    ages: Float[Array, " pictures"]
    weights: Float[Array, "pictures bends"]

    @classmethod
    def empty(cls, bends: int) -> "BiasField":
        """The field before the first picture: zero."""
        zeros = jnp.zeros((PICTURES, bends))
        return cls(zeros, zeros, zeros, jnp.full(PICTURES, NONE), zeros)

    def at(self, bends: Float[Array, " bends"]) -> Float[Array, " bends"]:
        """Expected bend biases at sensed bends [rad]."""
        covariance = _covariance(bends[None], jnp.zeros(1), self.bends, self.ages)
        return covariance[0] @ self.weights

    def aged(self, time: float) -> "BiasField":
        """The field after some time [s]."""
        return self._replace(ages=self.ages + time)

    def with_picture(
        self,
        bends: Float[Array, " bends"],
        caused: Float[Array, " bends"],
        by_payload: Float[Array, " bends"],
        age: Float[Array, ""],
        known_payload: Float[Array, ""],
        payload_std: float,
    ) -> "BiasField":
        """The field with one more picture, in place of the oldest.

        Args:
            bends: sensed when it was taken [rad].
            caused: bends by biases and payload that explain it [rad].
            by_payload: their derivative by the payload [rad/kg].
            age: time since it was taken [s].
            known_payload: most likely before any picture [kg].
            payload_std: standard deviation of the payload before any picture [kg].
        """
        oldest = jnp.argmax(self.ages)
        points = self.bends.at[oldest].set(bends)
        targets = self.caused.at[oldest].set(caused)
        bases = self.by_payload.at[oldest].set(by_payload)
        ages = self.ages.at[oldest].set(age)
        noise = (NOISE / STD) ** 2 * jnp.eye(PICTURES)
        root = jnp.linalg.cholesky(_covariance(points, ages, points, ages) + noise)
        rest = targets - known_payload * bases
        solved = jax.scipy.linalg.cho_solve((root, True), jnp.hstack([rest, bases]))
        weights, base_weights = jnp.split(solved, 2, axis=-1)
        information = jnp.sum(bases * base_weights) + (STD / payload_std) ** 2
        payload = jnp.sum(bases * weights) / information
        weights = weights - payload * base_weights
        return BiasField(points, targets, bases, ages, weights)


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
