"""Estimate of an arm's state, the input of planner and controller."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics.bends import Numbers, Scalar
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import Memory
from s2c2a.printing import short_text

Vectors = Float[Numbers, "modules 3"]


class Estimate(NamedTuple):
    """Estimate of a state estimator after a reading.

    Attributes:
        configuration: configuration of every module, module frame, shape (modules, 3).
        disturbances: payload and bend biases; None if they are not estimated.
        covariance: covariance of the filter's state, if the estimator has one.
        external_force: force at the tip that would cause the bend biases [N].
        rejected: sensor name -> whether its measurements are rejected now.
        hysteresis: memory of the forward model after this reading
            (`ForwardModel.observe`), which the planner takes; None if the estimator does
            not follow it.
        memory: memory of the estimator for its next update.
        seen: module ends in a new picture [m], base frame, shape (modules, 3); NaN
            where there is none, and None if the estimator takes no pictures.
    """

    configuration: Vectors
    disturbances: Disturbances | None = None
    covariance: Float[Array, "states states"] | None = None
    external_force: Scalar | None = None
    rejected: Mapping[str, Array] = {}
    hysteresis: Memory = None
    memory: Any = ()
    seen: Vectors | None = None

    def __repr__(self) -> str:
        """Fields, and shapes of arrays."""
        return short_text(self)

    @classmethod
    def of(
        cls,
        configuration: Vectors,
        payload: float | Array = 0.0,
        bend_biases: Float[Numbers, "modules 2"] | None = None,
        hysteresis: Memory = None,
        memory: Any = (),
    ) -> "Estimate":
        """Build an estimate from arrays.

        Args:
            configuration: configuration of every module, module frame, shape
                (modules, 3).
            payload: mass at the tip [kg].
            bend_biases: bends beside the predicted ones [rad]; zero if None.
            hysteresis: memory of the forward model after this reading.
            memory: memory of the estimator for its next update.
        """
        if bend_biases is None:
            bend_biases = np.zeros((len(configuration), 2), np.float32)
        disturbances = Disturbances(
            jnp.asarray(payload, jnp.float32), jnp.asarray(bend_biases, jnp.float32)
        )
        configuration = jnp.asarray(configuration, jnp.float32)
        return cls(configuration, disturbances, hysteresis=hysteresis, memory=memory)

    @property
    def payload(self) -> float:
        """Mass at the tip [kg]."""
        return 0.0 if self.disturbances is None else float(self.disturbances.payload)

    @property
    def bend_biases(self) -> Float[np.ndarray, "modules 2"]:
        """Bends beside the predicted ones [rad]."""
        if self.disturbances is None:
            return np.zeros((len(self.configuration), 2))
        return np.asarray(self.disturbances.bend_biases, float)

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Columns of an episode.

        They are `sensed`, `payload`, `bend_biases`, `external_force` and
        `rejected.NAME`.
        """
        columns = {"sensed": np.asarray(self.configuration)}
        if self.disturbances is not None:
            columns["payload"] = np.asarray(self.payload)
            columns["bend_biases"] = self.bend_biases
        if self.external_force is not None:
            columns["external_force"] = np.asarray(self.external_force, float)
        for name, rejected in self.rejected.items():
            columns[f"rejected.{name}"] = np.asarray(rejected, float)
        return columns
