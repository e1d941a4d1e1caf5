"""Coverage of a recording: which bends, speeds and tip positions it contains.

Bends are sensed ones, as the forward model gets them (`ConfigurationMap`). An arm with
the same tip position can have many shapes, so a recording may cover the workspace and
yet lack S shapes, where neighboring modules bend in opposite directions.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.episodes import Episode
from s2c2a.estimation import configuration_map_for
from s2c2a.kinematics import (
    bends_from_configurations,
    commanded_part,
    states_from_bends,
)
from s2c2a.paper import Bends, disc_points
from s2c2a.spaces import POSITION, Reading

# a figure and its numbers show these; nothing else depends on them
HOLD = 0.01  # of the step limit; slower motion counts as a hold
NEAR_BEND = 0.25  # of each module's limit: distance at which a bend is reached
NEAR_TIP = 0.05  # of the arm's length: distance at which a position is reached
MIN_BEND = 0.1  # of the limit; smaller bends are neither opposed nor equal
RANDOM_SHAPES = 1000  # a share of them is known to 3 %


@dataclass(frozen=True, eq=False)  # holds arrays
class Coverage:
    """Bends, speeds and tip positions of a recording.

    Attributes:
        arm: the recorded arm.
        bends: sensed bends [rad], module frames, shape (samples, modules, 2).
        speeds: largest change of a module's bend [rad/s], shape (steps,).
        tips: measured tip positions [m], base frame, shape (tips, 3); empty without
            tracking.
    """

    arm: ArmSpec
    bends: Bends
    speeds: Float[np.ndarray, " steps"]
    tips: Float[np.ndarray, "tips 3"]

    @classmethod
    def of(cls, episodes: Sequence[Episode]) -> "Coverage":
        """Coverage of the episodes of one arm.

        Raises:
            ReadingError: an episode lacks a sensor that configurations need.
        """
        arm = episodes[0].arm
        bends = []
        speeds = []
        tips = [np.zeros((0, 3))]
        for episode in episodes:
            values = {name: episode.sensor(name) for name in episode.sensors}
            sensed = configuration_map_for(episode.arm).configurations(
                Reading(0.0, values)
            )
            bends.append(np.asarray(bends_from_configurations(sensed), float))
            changes = np.linalg.norm(np.diff(bends[-1], axis=0), axis=-1)
            speeds.append(changes.max(axis=-1) / np.diff(episode["time"]))
            if "states" in values:
                tips.append(values["states"][:, -1, POSITION].astype(float))
        return cls(arm, *map(_finite_rows, (bends, speeds, tips)))

    @property
    def limits(self) -> Float[np.ndarray, " modules"]:
        """Largest sensed bend of a plan [rad], shape (modules,)."""
        return ArmGeometry.of(self.arm).planned_bends

    @property
    def fastest(self) -> float:
        """The step limit as a speed [rad/s]."""
        return ArmGeometry.of(self.arm).step_limit * self.arm.control_rate

    def neighboring_bends(
        self, inner: int
    ) -> tuple[Float[np.ndarray, " samples"], Float[np.ndarray, " samples"]]:
        """Bends of two neighbors in the direction of the outer one [rad].

        Equal bends have equal values; in an S shape the first is negative.

        Args:
            inner: index of the inner module.

        Returns:
            b_i . b_o / |b_o| and |b_o|, with the bends of the inner and outer module.
        """
        outer = self.bends[:, inner + 1]
        sizes = np.linalg.norm(outer, axis=-1)
        products = np.sum(self.bends[:, inner] * outer, axis=-1)
        along = np.divide(products, sizes, out=np.zeros_like(sizes), where=sizes > 0)
        return along, sizes

    def opposed_share(self, inner: int) -> float:
        """Share of S shapes among samples in which both neighbors bend in one plane.

        Args:
            inner: index of the inner module.
        """
        along, outer = self.neighboring_bends(inner)
        bent = np.abs(along) > MIN_BEND * self.limits[inner]
        bent &= outer > MIN_BEND * self.limits[inner + 1]
        return _share(along[bent] < 0.0)

    def reached_bends(self, modules: slice = slice(None)) -> float:
        """Share of random bends of some modules that the recording reaches.

        Random bends are uniform within the limits of plans. One is reached if in some
        sample each component of every module's bend differs by at most `NEAR_BEND` of
        the module's limit. NaN without samples.

        Args:
            modules: that are compared.
        """
        limits = self.limits[modules, None]
        wanted = self._random_bends(self.limits)[:, modules] / limits
        samples = self.bends[:, modules] / limits
        return _reached(wanted, samples, NEAR_BEND, np.inf)

    def reached_tips(self) -> float:
        """Share of the nominal workspace that the measured tips reach.

        The nominal workspace consists of the tips of arcs with random true bends within
        the limits. A tip is reached if some measured one is within `NEAR_TIP` of the
        arm's length. NaN without measured tips.
        """
        geometry = ArmGeometry.of(self.arm)
        bends = jnp.asarray(self._random_bends(geometry.bend_limits))
        states = np.asarray(states_from_bends(bends, jnp.asarray(geometry.lengths)))
        wanted = states[:, -1, POSITION]
        return _reached(wanted, self.tips, NEAR_TIP * self.arm.length, 2.0)

    def _random_bends(self, limits: Float[np.ndarray, " modules"]) -> Bends:
        """Random bends of this arm [rad], uniform in discs whose radii are the limits."""
        random = np.random.default_rng(0)
        points = disc_points(random, (RANDOM_SHAPES, len(limits)))
        steerable = ArmGeometry.of(self.arm).steerable
        return np.asarray(commanded_part(limits[:, None] * points, steerable))


def _finite_rows(parts: Sequence[np.ndarray]) -> np.ndarray:
    values = np.concatenate(parts)
    axes = tuple(range(1, values.ndim))
    return values[np.isfinite(values).all(axis=axes)]


def _share(mask: np.ndarray) -> float:
    """Share of true values; NaN without any value."""
    return float(mask.mean()) if mask.size else float("nan")


def _reached(
    wanted: np.ndarray, samples: np.ndarray, distance: float, norm: float
) -> float:
    """Share of wanted points with a sample within a distance; NaN without samples.

    Args:
        wanted: points, shape (points, ...).
        samples: shape (samples, ...).
        distance: largest one, in the unit of both.
        norm: order of the Minkowski norm.
    """
    from scipy.spatial import cKDTree  # noqa: PLC0415  # heavy

    if not len(samples):
        return float("nan")
    tree = cKDTree(samples.reshape(len(samples), -1))
    points = wanted.reshape(len(wanted), -1)
    nearest, _ = tree.query(points, p=norm, distance_upper_bound=distance)
    return _share(np.isfinite(nearest))
