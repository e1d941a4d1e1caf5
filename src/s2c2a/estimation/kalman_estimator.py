"""The state estimator of the recipe `best`: encoders and a Kalman filter."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.arm.spec import warn_of_payload
from s2c2a.data import Recording
from s2c2a.estimation.configuration_maps import ConfigurationMap, Measured
from s2c2a.estimation.disturbance_filter import DisturbanceFilter, FilterOptions
from s2c2a.estimation.estimate import Estimate
from s2c2a.estimation.estimator import (
    EncoderEstimator,
    EstimationSettings,
    EstimatorOptions,
    SensorProgress,
    StateEstimator,
)
from s2c2a.estimation.filter_state import FilterState
from s2c2a.estimation.measurements import MeasurementReader, missing_values
from s2c2a.estimation.modal_model import (
    ModalFactors,
    ModalTable,
    identify_modal_factors,
)
from s2c2a.estimation.sensor_models import (
    PREFIX,
    Measurements,
    SensorSamples,
    sensor_models_of,
    train_sensor,
    untrained_sensors,
)
from s2c2a.execution.compilation import compiled, select_if_finite
from s2c2a.kinematics import bends_from_states
from s2c2a.models.forward_model import ForwardModel
from s2c2a.spaces import Actions, Reading
from s2c2a.training import Trained, TrainingData

MODAL_MODEL = "modal_model"
"""Name of the modal factors among the networks of a strategy."""


class KalmanEstimator(StateEstimator):
    """Configurations from encoders; payload and bend biases from all other sensors.

    Attributes:
        configuration_map: from encoders to configurations.
        filter: the Kalman filter.
        payload: known mass at the tip [kg].
        reader: of the measurements of the other sensors.
    """

    def __init__(
        self,
        arm: ArmSpec,
        configuration_map: ConfigurationMap,
        disturbance_filter: DisturbanceFilter,
        payload: float = 0.0,
    ):
        """Build the estimator; it compiles when first used.

        Args:
            arm: arm with its sensors.
            configuration_map: map from encoders to configurations.
            disturbance_filter: Kalman filter for the other sensors.
            payload: known mass at the tip [kg].
        """
        self.filter = disturbance_filter
        self.configuration_map = configuration_map
        self._inputs = configuration_map.inputs
        self.payload = np.float32(payload)
        self.reader = MeasurementReader(arm, disturbance_filter.sensors)
        self._start = compiled(start_estimate, configuration_map, disturbance_filter)
        self._update = compiled(update_estimate, configuration_map, disturbance_filter)

    @property
    def sensors(self) -> tuple[str, ...]:
        """See `StateEstimator`: other sensors may be missing at any time."""
        return self.configuration_map.sensors

    def start(self, reading: Reading) -> Estimate:
        self.reader.reset()
        return self._start(self._inputs(reading), self.payload)

    def update(
        self, estimate: Estimate, reading: Reading, last_command: Actions
    ) -> Estimate:
        measurements = self.reader.measurements(reading)
        inputs = self._inputs(reading)
        return self._update(estimate.memory, inputs, measurements)


def start_estimate(
    configuration_map: ConfigurationMap,
    disturbance_filter: DisturbanceFilter,
    inputs: Measured,
    payload: Float[Array, ""],
) -> Estimate:
    """Estimate of an arm at rest."""
    configuration = configuration_map(inputs)
    state = disturbance_filter.start(configuration, payload)
    nothing = missing_values(disturbance_filter.sensors)
    return _estimate(disturbance_filter, configuration, state, nothing)


def update_estimate(
    configuration_map: ConfigurationMap,
    disturbance_filter: DisturbanceFilter,
    last: FilterState,
    inputs: Measured,
    measurements: Measurements,
) -> Estimate:
    """One update; the last state replaces a result that is not finite."""
    configuration = configuration_map(inputs)
    state = disturbance_filter.update(last, configuration, measurements)
    state = select_if_finite(state, last)
    return _estimate(disturbance_filter, configuration, state, measurements)


def _estimate(
    disturbance_filter: DisturbanceFilter,
    configuration: Float[Array, "modules 3"],
    state: FilterState,
    measurements: Measured,
) -> Estimate:
    disturbances = state.disturbances
    biases = disturbances.bend_biases.reshape(-1)
    rejected = disturbance_filter.unused(state)
    seen = measurements.get("camera_positions")
    if seen is not None:
        seen = jnp.where(rejected["camera"], jnp.nan, seen)
    return Estimate(
        configuration,
        disturbances,
        covariance=state.covariance,
        external_force=disturbance_filter.external_force(biases),
        rejected=rejected,
        hysteresis=state.hysteresis,
        memory=state,
        seen=seen,
    )


@dataclass(frozen=True)
class KalmanFilter(FilterOptions, EstimatorOptions):
    """Options of the Kalman filter (`FilterOptions`).

    The planner uses the configurations of the encoders. The filter estimates payload
    and bend biases from all other sensors of the arm file. Without other sensors
    nothing is estimated.
    """

    supports = frozenset(
        {"known_payload", "disturbance_estimation", "max_compensated_force"}
    )

    def build(
        self,
        arm: ArmSpec,
        configuration_map: ConfigurationMap,
        model: ForwardModel,
        networks: Mapping[str, Any],
        settings: EstimationSettings,
    ) -> StateEstimator:
        """See `EstimatorOptions`: without other sensors, the encoders alone."""
        warn_of_payload(settings.known_payload, arm)
        sensors = sensor_models_of(arm, model, networks)
        if not sensors:
            return EncoderEstimator(configuration_map, model, settings.known_payload)
        factors = networks.get(MODAL_MODEL, ModalFactors.nominal())
        max_force = settings.max_compensated_force
        disturbance_filter = DisturbanceFilter(
            # bends are relative to the base, and so is what the filter computes
            model=model.in_base(),
            modal_table=ModalTable.of(arm, factors),
            sensors=sensors,
            options=self,
            mass=arm.mass,
            period=arm.control_period,
            estimates=settings.disturbance_estimation,
            max_force=np.inf if max_force is None else max_force,
        )
        return KalmanEstimator(
            arm, configuration_map, disturbance_filter, settings.known_payload
        )

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> dict[str, Any]:
        """See `EstimatorOptions`: modal factors and sensor networks."""
        return {MODAL_MODEL: ModalFactors.nominal()} | untrained_sensors(arm, key)

    def train(
        self, data: TrainingData, predicted_states: np.ndarray
    ) -> dict[str, Trained]:
        """See `EstimatorOptions`: the factors of the modal model.

        Their error is in percent of the fast error without them.
        """
        equilibria = bends_from_states(jnp.asarray(predicted_states, jnp.float32))
        bends = bends_from_states(jnp.asarray(data.states, jnp.float32))
        factors, without, remaining = identify_modal_factors(
            data.arm, np.asarray(equilibria), np.asarray(bends)
        )
        percent = 100.0 * remaining / without if without > 0 else 100.0
        curve = np.array(
            [[0.0, without, without], [1.0, remaining, remaining]], np.float32
        )
        return {MODAL_MODEL: Trained(factors, curve, (percent, 0.0))}

    def train_sensors(
        self, recording: Recording, key: PRNGKeyArray, progress: SensorProgress
    ) -> dict[str, Trained]:
        states = jnp.asarray(recording.sensor("states"), jnp.float32)
        bends = np.asarray(bends_from_states(states))
        arm = recording.arm
        trained = {}
        for name, shape in arm.sensors.learned_shapes(arm.module_count).items():
            if name not in recording.sensors:
                continue
            values = recording.sensor(name)
            if values.shape[2:] != shape:
                continue
            samples = SensorSamples.of(bends, values, recording.lengths)
            trained[f"{PREFIX}{name}"] = train_sensor(
                arm, samples, key, partial(progress, name)
            )
        return trained
