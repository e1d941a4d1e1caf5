"""Learned sensor models: a network maps bends to the values of a sensor.

They model flex sensors, and any other sensor that depends on the bends of the modules
(`[[sensors.raw]]` in the arm file).
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.arm.backlash import play
from s2c2a.estimation.sensor_models.base import (
    BiasPrior,
    ExpectedState,
    Innovation,
    Measurements,
    NamedSensor,
    Values,
    with_jacobian,
)
from s2c2a.models.layers import Scaling
from s2c2a.training.fit import Fixed

PREFIX = "sensors."
"""Of the names of learned sensors among the networks of a strategy."""
HIDDEN = 24  # units of a layer; the values of a sensor are smooth in the bends
DEPTH = 2  # layers
# Residuals of a network are correlated with the motion, so the filter would attribute
# them to bend biases. These factors enlarge noise and drift beyond the residuals.
NOISE_FACTOR = 6.0
DRIFT_FACTOR = 12.0


class SensorErrors(Fixed):
    """Errors of a learned sensor, in its own unit.

    Attributes:
        noise: standard deviation of the short-term errors, shape (values,).
        initial_bias: standard deviation of the biases when the arm is opened.
        drift: standard deviation of their change in one second.
        backlash: half-width of the hysteresis when bends reverse.
    """

    noise: Values
    initial_bias: Values
    drift: Values
    backlash: Values


class SensorNetwork(eqx.Module):
    """Maps the bends of all modules to the values of a sensor.

    Attributes:
        network: from bends [rad] to scaled values.
        scaling: of the values.
        errors: that remain.
    """

    network: eqx.nn.MLP
    scaling: Scaling
    errors: SensorErrors

    @classmethod
    def untrained(cls, arm: ArmSpec, values: int, key: PRNGKeyArray) -> "SensorNetwork":
        """Random weights, for a sensor with so many values."""
        network = eqx.nn.MLP(
            2 * arm.module_count, values, HIDDEN, DEPTH, jax.nn.tanh, key=key
        )
        errors = SensorErrors(*[jnp.ones(values)] * 4)
        return cls(network, Scaling.identity(values), errors)

    def __call__(self, bends: Float[Array, " bends"]) -> Values:
        """Predicted values in the sensor's unit."""
        return self.scaling.back(self.network(bends))


class LearnedSensor(NamedSensor):
    """A sensor whose network, bias, drift and hysteresis were learned from a recording.

    Attributes:
        network: trained.
    """

    network: SensorNetwork

    @property
    def bias_prior(self) -> BiasPrior:
        errors = self.network.errors
        return BiasPrior(errors.initial_bias, DRIFT_FACTOR * errors.drift)

    def initial_lag(self, bends: Float[Array, "modules 2"]) -> Array:
        return self.network(bends.reshape(-1))

    def innovation(
        self, measurements: Measurements, expected: ExpectedState
    ) -> Innovation:
        """See `SensorModel`: the Jacobian neglects the hysteresis of the sensor."""
        predicted, jacobian = with_jacobian(self.network, expected.bends)
        errors = self.network.errors
        low = predicted - errors.backlash
        high = predicted + errors.backlash
        lag = play(expected.lag, low, high)
        residual = measurements[self.name].reshape(-1) - lag
        return Innovation(residual, jacobian, NOISE_FACTOR * errors.noise, lag=lag)


def untrained_sensors(arm: ArmSpec, key: PRNGKeyArray) -> dict[str, SensorNetwork]:
    """Untrained networks of all sensors that the arm file leaves to learning."""
    shapes = arm.sensors.learned_shapes(arm.module_count)
    return {
        f"{PREFIX}{name}": SensorNetwork.untrained(arm, int(np.prod(shape)), key)
        for name, shape in shapes.items()
    }


def learned_sensors(
    arm: ArmSpec, networks: Mapping[str, eqx.Module]
) -> tuple[LearnedSensor, ...]:
    """Learned sensors that the arm file lists and whose networks were trained."""
    sensors = []
    for name, shape in arm.sensors.learned_shapes(arm.module_count).items():
        network = networks.get(f"{PREFIX}{name}")
        if not isinstance(network, SensorNetwork):
            continue
        if len(network.errors.noise) == np.prod(shape):
            sensors.append(LearnedSensor(name, shape, network))
    return tuple(sensors)
