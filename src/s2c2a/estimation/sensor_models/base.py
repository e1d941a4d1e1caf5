"""Interface of sensor models: predicted measurements and their innovation."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmSpec
from s2c2a.kinematics.bends import FlatBends, Numbers, Scalar
from s2c2a.models.arrays import ModuleBends
from s2c2a.models.forward_model import ForwardModel

PastBends = Float[Array, "steps modules 2"]
# rad, from the prediction: two step limits of 4 deg; beyond, a measurement is wrong
MAX_BEND_CHANGE = 0.14
EMPTY = np.zeros(0, np.float32)
Values = Float[Array, " values"]
Measurements = Mapping[str, Array]
"""Sensor name -> measured values; NaN for what is missing."""


class ExpectedState(NamedTuple):
    """Prediction of the state estimator before the update with a measurement.

    Attributes:
        bends: bends of the modules [rad], shape (modules, 2).
        bend_biases: the part of them that is bend bias [rad], shape (modules, 2).
        tensions: cable tensions in equilibrium without bend biases [N], shape (modules,
            cables); NaN if the forward model does not predict them.
        past_bends: bends of the last control steps, newest first [rad], shape (steps,
            modules, 2).
        past_sensed: those of the encoders alone, likewise.
        past_states: states of the same steps, shape (steps, modules, 6).
        bias_change: change of the estimated disturbance bends since each of these steps
            [rad], shape (steps, modules, 2).
        lag: memory of the sensor's hysteresis (`SensorModel.initial_lag`).
    """

    bends: ModuleBends
    bend_biases: ModuleBends
    tensions: Float[Array, "modules cables"]
    past_bends: PastBends
    past_sensed: PastBends
    past_states: Float[Array, "steps modules 6"]
    bias_change: PastBends
    lag: Numbers = EMPTY


class Innovation(NamedTuple):
    """A measurement less its prediction.

    Attributes:
        residual: measured less predicted values; not finite where a value is missing,
            shape (values,).
        jacobian: derivative of the prediction by the bends, shape (values, 2 modules).
        std: standard deviation of the measurement noise, shape (values,).
        max_change: residuals that differ more from their slow averages are a fault of the
            sensor, shape () or (values,); negative where the measurement itself is one.
        beside_encoders: measured less what encoders alone predict, shape (values,); None
            where they predict nothing.
        lag: memory of the sensor's hysteresis after this measurement.
        age: time since the measurement was taken [s].
    """

    residual: Values
    jacobian: Float[Array, "values bends"]
    std: Values
    max_change: float | Float[Array, "..."] = np.inf
    beside_encoders: Values | None = None
    lag: Numbers = EMPTY
    age: float | Scalar = 0.0


class BiasPrior(NamedTuple):
    """Random walk of the sensor's biases, which the filter estimates.

    Attributes:
        initial_std: standard deviation when the arm is opened, shape (biases,); empty
            for a sensor without bias.
        drift: standard deviation of the change in one second, shape (biases,).
    """

    initial_std: Float[Array, " biases"]
    drift: Float[Array, " biases"]

    @classmethod
    def none(cls) -> "BiasPrior":
        """Of a sensor without bias."""
        return cls(jnp.zeros(0), jnp.zeros(0))


class SensorModel(eqx.Module):
    """One sensor, or several of a kind.

    Attributes:
        name: of the sensor in recipes, arm files and diagnostics.
        measures_equilibrium: whether its values are compared with the equilibrium that
            the arm approaches, not with its vibration.
        sees_ends: whether its values are positions of module ends, from which the bend
            biases are learned as a function of the shape.
        max_delay: oldest measurement that it uses [s].
    """

    name: ClassVar[str] = ""
    measures_equilibrium: ClassVar[bool] = False
    sees_ends: ClassVar[bool] = False
    max_delay: ClassVar[float] = 0.0

    @property
    def max_silence(self) -> float:
        """Without measurements for longer, it is reported as rejected [s]."""
        return 1.0

    @property
    def value_count(self) -> int:
        """Number of values of its innovation; that of its measurements by default."""
        return sum(values.size for values in self.missing().values())

    @classmethod
    def of(cls, arm: ArmSpec, model: ForwardModel) -> "SensorModel | None":
        """The model of this sensor on an arm; None if the arm does not have it."""
        return None

    @property
    def bias_prior(self) -> BiasPrior:
        """Biases of the sensor that the filter estimates."""
        return BiasPrior.none()

    def initial_lag(self, bends: ModuleBends) -> Numbers:
        """Memory of the sensor's hysteresis at rest; empty if it has none."""
        return EMPTY

    @abstractmethod
    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        """Compare a measurement with its prediction."""

    @abstractmethod
    def missing(self) -> dict[str, np.ndarray]:
        """NaN in the shape of every measured value, by its name in a reading."""


class NamedSensor(SensorModel):
    """A sensor that the arm file names.

    Attributes:
        name: in readings.
        shape: of one measurement.
    """

    name: str = eqx.field(static=True)  # type: ignore[misc]  # set by the arm file
    shape: tuple[int, ...] = eqx.field(static=True)

    def missing(self) -> dict[str, np.ndarray]:
        return {self.name: np.full(self.shape, np.nan, np.float32)}


class FormulaSensor(NamedSensor):
    """A sensor whose values follow from the bends by a formula.

    Name it in the arm file: `[[sensors.raw]]`, `model = "my_sensor.py:MySensor"`. The
    entry gives name and shape; the class gives formula and noise.
    """

    @abstractmethod
    def predicted(self, bends: ModuleBends) -> Float[Array, "*shape"]:
        """The values that the sensor measures at these bends, in JAX."""

    @property
    @abstractmethod
    def std(self) -> float:
        """Standard deviation of the measurement noise, in the sensor's unit."""

    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        def flat(bends: FlatBends) -> Values:
            return self.predicted(bends.reshape(-1, 2)).reshape(-1)

        predicted, jacobian = with_jacobian(flat, expected.bends)
        residual = measurements[self.name].reshape(-1) - predicted
        return Innovation(residual, jacobian, jnp.full(predicted.shape, self.std))


def with_jacobian(
    predict: Callable[[Array], Array], bends: ModuleBends
) -> tuple[Values, Float[Array, "values bends"]]:
    """Predicted values and their derivative by the bends."""
    flat = bends.reshape(-1)
    return predict(flat), jax.jacfwd(predict)(flat)


def interpolated(
    history: Float[Array, "steps *shape"], steps: Scalar
) -> Float[Array, "*shape"]:
    """The value of some, perhaps fractional, steps ago."""
    newer = jnp.floor(steps).astype(int)
    share = steps - newer
    return (1.0 - share) * history[newer] + share * history[newer + 1]
