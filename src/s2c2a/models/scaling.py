"""Scaling to [-1, 1] and back."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.training import Fixed


class Scaling(Fixed):
    """An affine map that takes `centre - half_range` to -1 and `centre + half_range` to 1, for each feature."""

    centre: Float[Array, " features"]
    half_range: Float[Array, " features"]

    @classmethod
    def of(cls, values: Float[np.ndarray, "*batch features"]) -> "Scaling":
        """The map that just fits the values; a feature that never changes keeps its unit."""
        flat = values.reshape(-1, values.shape[-1])
        low, high = flat.min(axis=0), flat.max(axis=0)
        half = np.where(high > low, (high - low) / 2, 1.0)
        return cls(jnp.asarray((low + high) / 2, dtype=jnp.float32), jnp.asarray(half, dtype=jnp.float32))

    @classmethod
    def identity(cls, features: int) -> "Scaling":
        """The map that changes nothing, to be filled from a file."""
        return cls(jnp.zeros(features), jnp.ones(features))

    def forward(self, values: Float[Array, "*batch features"]) -> Float[Array, "*batch features"]:
        """To [-1, 1]."""
        return (values - self.centre) / self.half_range

    def back(self, values: Float[Array, "*batch features"]) -> Float[Array, "*batch features"]:
        """From [-1, 1]."""
        return values * self.half_range + self.centre
