"""Obstacles that are nearest to the guarded points of an arm, and their clearances."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.goals import Goal
from s2c2a.obstacles import distances
from s2c2a.planning.terms import GuardedPoints

FAR = 1e6  # m; clearance from an obstacle that is not there
Clearances = Float[Array, "points obstacles"]
States = Float[Array, "modules 6"]


class Nearby(NamedTuple):
    """A few obstacles.

    Attributes:
        centers: [m], base frame, shape (obstacles, 3).
        thresholds: [m], zero for unused rows, shape (obstacles,).
        cores: see `s2c2a.obstacles`, shape (obstacles, 8).
    """

    centers: Float[Array, "obstacles 3"]
    thresholds: Float[Array, " obstacles"]
    cores: Float[Array, "obstacles 8"]

    @classmethod
    def of(cls, goal: Goal) -> "Nearby":
        """All obstacles of a goal."""
        rows = goal.obstacles, goal.thresholds, goal.cores
        return cls(*(jnp.asarray(row, jnp.float32) for row in rows))

    def nearest(self, states: States, guarded: GuardedPoints, count: int) -> "Nearby":
        """The obstacles nearest to an arm, by their least clearance."""
        least = self.clearances(states, guarded).min(axis=0)
        count = min(count, len(least))
        _, rows = jax.lax.top_k(-least, count)
        return Nearby(*(values[rows] for values in self))

    def clearances(self, states: States, guarded: GuardedPoints) -> Clearances:
        """Distances of the body from thresholds [m]; `FAR` for unused rows."""
        points = guarded(states)[:, None]
        gaps = distances(points, self.centers, self.cores)
        radii = jnp.asarray(guarded.radii)[:, None]
        clear = gaps - self.thresholds - radii
        is_used = self.thresholds > 0.0
        return jnp.where(is_used, clear, FAR)
