"""A state estimator of your own: bend biases from motion capture, by a slow integrator.

    s2c2a run circle --recipe own_estimator.toml --weights mine.safetensors --payload 0.05

own_estimator.toml is based on the recipe `best` and names this estimator. Its memory is
in the estimate: the model's hysteresis, which the planner takes, and the bend biases.
"""

from dataclasses import dataclass

import jax.numpy as jnp

from s2c2a.estimation import Estimate, EstimatorOptions, StateEstimator
from s2c2a.execution.compilation import compiled
from s2c2a.kinematics import bends_from_configurations, bends_from_states


def update(configuration_map, model, gain, inputs, measured, hysteresis, biases):
    """One filter step in JAX: configuration, hysteresis and bend biases."""
    configuration = configuration_map(inputs)
    predicted = bends_from_states(model.predict(configuration, hysteresis))
    residual = bends_from_configurations(measured) - predicted
    biases = biases + gain * (residual - biases)
    return configuration, model.observe(configuration, hysteresis), biases


class SlowBiases(StateEstimator):
    """Configurations from encoders, bend biases from motion capture."""

    def __init__(self, configuration_map, model, gain):
        self.map = configuration_map
        self.model = model
        self.compiled_update = compiled(update, configuration_map, model, gain)

    @property
    def sensors(self):
        return (*self.map.sensors, "configurations")

    def start(self, reading):
        configuration = jnp.asarray(self.map.configurations(reading))
        return Estimate.of(configuration, hysteresis=self.model.start(configuration))

    def update(self, estimate, reading, last_command):
        inputs = self.map.inputs(reading)
        measured = jnp.asarray(reading["configurations"], jnp.float32)
        configuration, hysteresis, biases = self.compiled_update(
            inputs, measured, estimate.hysteresis, estimate.disturbances.bend_biases
        )
        return Estimate.of(configuration, bend_biases=biases, hysteresis=hysteresis)


@dataclass(frozen=True)
class Integrator(EstimatorOptions):
    """Gain of the integrator: share of the residual that each control step adds."""

    gain: float = 0.05

    def build(self, arm, configuration_map, model, networks, settings):
        return SlowBiases(configuration_map, model, self.gain)
