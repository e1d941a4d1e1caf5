"""State of the Kalman filter by name, and its order in vectors and matrices."""

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.estimation.bias_field import BiasField
from s2c2a.estimation.outliers import SensorHistory
from s2c2a.estimation.sensor_models.base import PastBends
from s2c2a.kinematics.bends import FlatBends, Scalar
from s2c2a.models.disturbances import Disturbances


class ArmState(NamedTuple):
    """What the filter estimates, by name; also standard deviations of the same.

    Attributes:
        payload: mass at the tip [kg].
        bend_biases: bends beside those that the forward model predicts and the field of
            the biases expects [rad], two for each module, one module after another.
        bends: true bends, with their vibration [rad], in the same order.
        bend_rates: their rates [rad/s], in the same order.
        sensor_biases: constant errors, one sensor after another.
    """

    payload: Scalar
    bend_biases: FlatBends
    bends: FlatBends
    bend_rates: FlatBends
    sensor_biases: Float[Array, " biases"]

    def packed(self) -> Float[Array, " states"]:
        """All of it in one vector, in the order of `StateOrder`."""
        return jnp.concatenate([jnp.atleast_1d(part) for part in self])


class StateOrder(NamedTuple):
    """Places of the named parts in vectors, rows and columns; the only place of them.

    Attributes:
        payload: of `ArmState`.
        bend_biases: of `ArmState`.
        bends: of `ArmState`.
        bend_rates: of `ArmState`.
        sensor_biases: of each sensor; empty for one without biases.
        size: of the whole vector.
    """

    payload: slice
    bend_biases: slice
    bends: slice
    bend_rates: slice
    sensor_biases: tuple[slice, ...]
    size: int

    @classmethod
    def of(cls, bends: int, bias_counts: list[int]) -> "StateOrder":
        """The order of so many bends, and biases of each sensor."""
        sizes = [1, bends, bends, bends, *bias_counts]
        ends = np.cumsum(sizes).tolist()
        places = [slice(end - size, end) for size, end in zip(sizes, ends, strict=True)]
        payload, bend_biases, own_bends, rates, *biases = places
        return cls(payload, bend_biases, own_bends, rates, tuple(biases), ends[-1])

    @property
    def vibration(self) -> slice:
        """Bends and bend rates, the state of the modal model."""
        return slice(self.bends.start, self.bend_rates.stop)

    def unpacked(self, vector: Float[Array, " states"]) -> ArmState:
        """The parts of a vector by name."""
        return ArmState(
            payload=vector[self.payload][0],
            bend_biases=vector[self.bend_biases],
            bends=vector[self.bends],
            bend_rates=vector[self.bend_rates],
            sensor_biases=vector[self.bend_rates.stop :],
        )


class FilterState(NamedTuple):
    """State of the filter between updates.

    Attributes:
        mean: the estimate.
        covariance: its covariance, in the order of `StateOrder`.
        moments: moments of the payload at the present shape (`Disturbances`).
        hysteresis: memory of the forward model.
        past_bends: bends of the last control steps, newest first [rad], shape (steps,
            modules, 2).
        past_states: predicted states of these steps [m, 1], base frame, shape (steps,
            modules, 6).
        past_disturbance_bends: bends due to payload and bend biases in these steps
            [rad], shape (steps, modules, 2).
        past_sensed: sensed bends in these steps [rad], shape (steps, modules, 2).
        histories: each sensor's past, by which outliers are recognized.
        field: bend biases as a function of the shape, as pictures have taught them; None
            if no sensor sees the module ends.
        expected_biases: of the field, at the present shape [rad], shape (bends,).
        known_payload: at the start [kg].
    """

    mean: ArmState
    covariance: Float[Array, "states states"]
    moments: Disturbances
    hysteresis: Any
    past_bends: PastBends
    past_states: Float[Array, "steps modules 6"]
    past_disturbance_bends: PastBends
    past_sensed: PastBends
    histories: tuple[SensorHistory, ...]
    field: BiasField | None
    expected_biases: FlatBends
    known_payload: Scalar

    @property
    def disturbances(self) -> Disturbances:
        """Payload and bend biases, with the moments of the payload."""
        moments = self.moments.with_payload(self.mean.payload)
        biases = self.expected_biases + self.mean.bend_biases
        return moments._replace(bend_biases=biases.reshape(-1, 2))
