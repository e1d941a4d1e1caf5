"""Rules by which the filter rejects a sensor.

1. A measurement beyond the gate, which no other payload explains, is an outlier.
2. A residual that leaves its slow average shows drift, wrong latency or a jump.
3. A sensor with one of these stays rejected for a while.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from s2c2a.estimation.sensor_models.base import EMPTY, Innovation, Values
from s2c2a.files.text import LARGEST
from s2c2a.kinematics.bends import Numbers, Scalar, Truth
from s2c2a.spaces import NOISE_LIMIT

# s, of a sensor after an outlier: several measurements of every sensor, so that
# one good measurement among wrong ones is not used
REJECTION_TIME = 0.5
# s, time constant of the usual residual: longer than vibrations of the arm, and
# shorter than an external force lasts, which the average must follow
SLOW_AVERAGING_TIME = 2.0


class SensorHistory(NamedTuple):
    """A sensor's past.

    Attributes:
        usual: slow averages of its residuals against encoders and payload, and against
            encoders alone, shape (2, values); `LARGEST` before the first measurement.
        unseen_for: time since the last measurement [s].
        rejected_for: remaining time of rejection [s].
        lag: memory of its hysteresis (`SensorModel.initial_lag`).
    """

    usual: Float[Array, "2 values"]
    unseen_for: Scalar
    rejected_for: Scalar
    lag: Numbers

    @classmethod
    def none(cls, values: int, lag: Numbers = EMPTY) -> "SensorHistory":
        """The past of a sensor that has not measured yet."""
        # with its type: a weak one would change at the first update, and compile anew
        usual = jnp.full((2, values), LARGEST, jnp.float32)
        return cls(usual, jnp.zeros(()), jnp.zeros(()), lag)


class Compared(NamedTuple):
    """A measurement compared with what encoders and payload let one expect.

    Attributes:
        unexplained: residual that no other payload explains.
        by_biases: the part of the prediction that is due to bend biases; they count as
            residual in rule 2, so that a fault that moves them shows, too.
        is_present: which values were measured.
        innovation: of the sensor model, with the limits of its residual.
    """

    unexplained: Values
    by_biases: Values
    is_present: Bool[Array, " values"]
    innovation: Innovation


def is_beyond_gate(
    residual: Values,
    covariance: Float[Array, "values values"],
    is_present: Bool[Array, " values"],
) -> Truth:
    """Rule 1: the normalized innovation exceeds the gate.

    It is the root mean square of the residuals in standard deviations of each.
    """
    squared = jnp.sum(residual**2 / jnp.diag(covariance))
    return jnp.sqrt(squared / jnp.maximum(is_present.sum(), 1)) > NOISE_LIMIT


def judged(
    history: SensorHistory, compared: Compared, is_outlier: Truth, period: float
) -> SensorHistory:
    """The sensor's past after a measurement.

    After an external force the average follows, and the sensor counts again.

    Args:
        history: before the measurement.
        compared: the measurement.
        is_outlier: whether it is beyond the gate, and no payload explains it.
        period: control period [s].
    """
    is_present = compared.is_present
    elapsed = history.unseen_for + period
    by_model = compared.unexplained + compared.by_biases
    by_encoders = compared.innovation.beside_encoders
    by_encoders = by_model if by_encoders is None else by_encoders
    residual = jnp.stack([by_model, by_encoders])
    start = jnp.where(history.usual == LARGEST, residual, history.usual)
    share = jnp.minimum(elapsed / SLOW_AVERAGING_TIME, 1.0)
    usual = start + share * (residual - start)
    # by both: with several equilibria, the model jumps while the arm and its sensor do not
    change = abs(residual - usual)
    has_left = (change > compared.innovation.max_change).all(axis=0)
    is_outlier = is_outlier | (is_present & has_left).any()
    remaining = jnp.maximum(history.rejected_for - period, 0.0)
    return SensorHistory(
        usual=jnp.where(is_present, usual, history.usual),
        unseen_for=jnp.where(is_present.any(), 0.0, elapsed),
        rejected_for=jnp.where(is_outlier, REJECTION_TIME, remaining),
        lag=compared.innovation.lag,
    )
