"""Interface of state estimators, and an estimator that uses encoders alone."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.arm.spec import MAX_PAYLOAD
from s2c2a.data import Recording
from s2c2a.errors import StrategyError
from s2c2a.estimation.configuration_maps import (
    ConfigurationMap,
    Configurations,
    Measured,
)
from s2c2a.estimation.estimate import Estimate
from s2c2a.execution.compilation import compiled
from s2c2a.models.forward_model import ForwardModel, Memory
from s2c2a.plugins.components import Component
from s2c2a.spaces import Actions, Reading
from s2c2a.training import Trained, TrainingData

SensorProgress = Callable[[str, int, int, float], None]


@dataclass(frozen=True)
class EstimationSettings:
    """Settings of a run about disturbances.

    Attributes:
        known_payload: mass at the tip [kg].
        disturbance_estimation: whether payload and bend biases are estimated;
            otherwise they keep their initial values.
        max_compensated_force: the arm yields to external forces beyond this one [N];
            None compensates all.
    """

    known_payload: float = 0.0
    disturbance_estimation: bool = True
    max_compensated_force: float | None = None

    def __post_init__(self):
        """Check the limits."""
        if not 0.0 <= self.known_payload < MAX_PAYLOAD:
            raise StrategyError(
                f"a known payload of {self.known_payload} kg was given; give one from "
                f"0 to {MAX_PAYLOAD:g} kg"
            )
        force = self.max_compensated_force
        if force is not None and not force >= 0.0:
            raise StrategyError(
                f"a maximum compensated force of {force} N was given; give 0 or more"
            )

    def check_supported(self, supported: frozenset[str], name: str) -> None:
        """Check that a strategy or estimator supports the settings.

        Args:
            supported: names of the attributes that it supports.
            name: name of the strategy or estimator.

        Raises:
            StrategyError: a setting without support differs from its default.
        """
        for setting in fields(self):
            given = getattr(self, setting.name)
            if given != setting.default and setting.name not in supported:
                raise StrategyError(
                    f"{name} does not support {OPTIONS[setting.name]} ({given}); leave "
                    "it out, or choose a strategy and a recipe that support it"
                )


OPTIONS = {
    "known_payload": "--known-payload",
    "disturbance_estimation": "--no-disturbance-estimation",
    "max_compensated_force": "--max-compensated-force",
}
"""Command-line options of the settings."""


class StateEstimator(ABC):
    """Estimates configuration, payload, bend biases and hysteresis from readings.

    It alone advances the hysteresis of the forward model, once for each reading. The
    estimate contains the memory between updates. The estimator compiles nothing after
    the first update.
    """

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Sensors that every reading must contain; the runtime checks them."""

    @abstractmethod
    def start(self, reading: Reading) -> Estimate:
        """Estimate of an arm at rest."""

    @abstractmethod
    def update(
        self, estimate: Estimate, reading: Reading, last_command: Actions
    ) -> Estimate:
        """Estimate after one more reading.

        Args:
            estimate: estimate of the last control step.
            reading: latest reading.
            last_command: command of the last control step [m or N], shape (modules,
                cables).

        Raises:
            ReadingError: the reading lacks a sensor.
        """


@dataclass(frozen=True)
class EstimatorOptions(Component, ABC):
    """Options of a state estimator, in the recipe: `[estimator]`, `name = "..."`.

    A subclass is a frozen dataclass; its fields are validated like those of all
    components (`s2c2a.plugins.components`).

    Attributes:
        supports: settings of a run that the estimator supports
            (`EstimationSettings.check_supported`).
    """

    supports: ClassVar[frozenset[str]] = frozenset()

    @abstractmethod
    def build(
        self,
        arm: ArmSpec,
        configuration_map: ConfigurationMap,
        model: ForwardModel,
        networks: Mapping[str, Any],
        settings: EstimationSettings,
    ) -> StateEstimator:
        """Build the estimator of an arm.

        Args:
            arm: arm with all of its sensors.
            configuration_map: map from readings to configurations of the arm file.
            model: trained forward model.
            networks: other trained networks, by name (`train`).
            settings: settings of the run.
        """

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> dict[str, Any]:
        """Untrained networks of the estimator, by name; by default none."""
        return {}

    def train(
        self, data: TrainingData, predicted_states: np.ndarray
    ) -> dict[str, Trained]:
        """Train the networks of the estimator; by default there are none.

        Args:
            data: training data of the forward model.
            predicted_states: predictions of the trained forward model for all episodes
                [m, 1].
        """
        return {}

    def train_sensors(
        self, recording: Recording, key: PRNGKeyArray, progress: SensorProgress
    ) -> dict[str, Trained]:
        """Learn what the sensors measure: by default nothing.

        Args:
            recording: with true states.
            key: of everything random.
            progress: called with sensor, epoch, number of epochs, validation loss.

        Raises:
            TrainingError: too few samples of a sensor.
        """
        return {}


class EncoderEstimator(StateEstimator):
    """Configurations from a map of the reading, and a payload that the user states.

    Its only memory is the hysteresis of the forward model.

    Attributes:
        configuration_map: from readings to configurations.
        model: forward model whose hysteresis it follows, or None.
        payload: mass at the tip [kg].
    """

    def __init__(
        self,
        configuration_map: ConfigurationMap,
        model: ForwardModel | None = None,
        payload: float = 0.0,
    ):
        """Build the estimator; it compiles when first used.

        Args:
            configuration_map: from readings to configurations.
            model: forward model whose hysteresis it follows; with None the planner
                does, if its model has any.
            payload: mass at the tip [kg].
        """
        self.configuration_map = configuration_map
        self.model = model
        self.payload = payload
        # Equinox takes as long to look a method up as the map takes to run
        self._inputs = configuration_map.inputs
        self._sensed = compiled(sense, configuration_map, model)

    @property
    def sensors(self) -> tuple[str, ...]:
        return self.configuration_map.sensors

    def start(self, reading: Reading) -> Estimate:
        configuration, hysteresis = self._sensed(self._inputs(reading), None)
        if not self.payload:
            return Estimate(configuration, hysteresis=hysteresis)
        return Estimate.of(configuration, self.payload, hysteresis=hysteresis)

    def update(
        self, estimate: Estimate, reading: Reading, last_command: Actions
    ) -> Estimate:
        inputs = self._inputs(reading)
        configuration, hysteresis = self._sensed(inputs, estimate.hysteresis)
        return estimate._replace(configuration=configuration, hysteresis=hysteresis)


def sense(
    configuration_map: ConfigurationMap,
    model: ForwardModel | None,
    inputs: Measured,
    hysteresis: Memory,
) -> tuple[Configurations, Memory]:
    """The configuration, and the hysteresis after it; None before: the arm is at rest."""
    configuration = configuration_map(inputs)
    if model is None:
        return configuration, None
    if hysteresis is None:
        return configuration, model.start(configuration)
    return configuration, model.observe(configuration, hysteresis)


@dataclass(frozen=True)
class EncoderOnly(EstimatorOptions):
    """Options of the estimator that uses encoders alone, as in the paper."""

    supports = frozenset({"known_payload"})

    def build(
        self,
        arm: ArmSpec,
        configuration_map: ConfigurationMap,
        model: ForwardModel,
        networks: Mapping[str, Any],
        settings: EstimationSettings,
    ) -> EncoderEstimator:
        """See `EstimatorOptions`.

        Raises:
            StrategyError: a payload is stated and the forward model ignores it.
        """
        if settings.known_payload and not model.takes_payload:
            raise StrategyError(
                f"a known payload of {settings.known_payload:g} kg was given, and the "
                "forward model of this recipe ignores payloads; take the recipe 'best'"
            )
        return EncoderEstimator(configuration_map, model, settings.known_payload)
