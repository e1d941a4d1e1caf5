"""The interface of state estimators, and the one that uses encoders alone."""

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.compilation import compiled
from s2c2a.components import Component
from s2c2a.data import Recording
from s2c2a.errors import StrategyError
from s2c2a.estimation.configuration_maps import ConfigurationMap
from s2c2a.estimation.estimate import Estimate
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel
from s2c2a.spaces import Actions, Reading
from s2c2a.training import Trained, TrainingData

MAX_PAYLOAD = 50.0  # kg
SensorProgress = Callable[[str, int, int, float], None]


@dataclass(frozen=True)
class EstimationSettings:
    """What a user states about the disturbances of a run.

    Attributes:
        known_payload: mass at the tip [kg].
        disturbance_estimation: whether payload and bend biases are estimated, or stay as
            stated.
        max_compensated_force: the arm yields to external forces beyond this one [N];
            None compensates all.
    """

    known_payload: float = 0.0
    disturbance_estimation: bool = True
    max_compensated_force: float | None = None

    def __post_init__(self):
        """Refuse impossible numbers."""
        if not 0.0 <= self.known_payload < MAX_PAYLOAD:
            raise StrategyError(
                f"a known payload of {self.known_payload} kg was given; give one from 0 "
                f"to {MAX_PAYLOAD:g} kg"
            )
        force = self.max_compensated_force
        if force is not None and not force >= 0.0:
            raise StrategyError(
                f"a maximum compensated force of {force} N was given; give 0 or more"
            )

    def check_supported(self, supported: frozenset[str], name: str) -> None:
        """Refuse settings that a strategy or estimator ignores.

        Args:
            supported: names of the attributes that it supports.
            name: of the strategy or estimator.

        Raises:
            StrategyError: one was given that it does not support.
        """
        default = EstimationSettings()
        for setting in (
            "known_payload",
            "disturbance_estimation",
            "max_compensated_force",
        ):
            given = getattr(self, setting)
            if given != getattr(default, setting) and setting not in supported:
                raise StrategyError(
                    f"{name} does not support {OPTIONS[setting]} ({given}); leave it "
                    "out, or choose a strategy and a recipe that support it"
                )


OPTIONS = {
    "known_payload": "--known-payload",
    "disturbance_estimation": "--no-disturbance-estimation",
    "max_compensated_force": "--max-compensated-force",
}
"""Settings by the command-line options that set them."""


class StateEstimator(ABC):
    """Estimates configuration, payload and bend biases from readings.

    Its memory between updates is in the estimate. Nothing may compile after the first
    update.
    """

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Sensors that every reading must hold; the runtime checks them."""

    @abstractmethod
    def start(self, reading: Reading) -> Estimate:
        """The estimate of an arm at rest."""

    @abstractmethod
    def update(
        self, estimate: Estimate, reading: Reading, last_command: Actions
    ) -> Estimate:
        """The estimate after one more reading.

        Args:
            estimate: the last one.
            reading: the latest.
            last_command: that was sent in the last control step [m or N], shape
                (modules, cables).

        Raises:
            ReadingError: the reading lacks a sensor.
        """


@dataclass(frozen=True)
class EstimatorOptions(Component, ABC):
    """The options of a state estimator, in the recipe: `[estimator]`, `name = "..."`.

    A frozen dataclass with the numbers of the estimator; they are checked as those of
    all components (`s2c2a.components`).

    Attributes:
        supports: which settings of a run the estimator supports
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
            arm: with all of its sensors.
            configuration_map: from readings to configurations, by the arm file.
            model: the trained forward model.
            networks: what else was trained, by name (`train`).
            settings: of the run.
        """

    def planning_arm(self, arm: ArmSpec) -> ArmSpec:
        """The arm as forward model and controller see it: by default as it is."""
        return arm

    def training_arm(self, arm: ArmSpec) -> ArmSpec:
        """The arm as its networks are trained: by default as it is."""
        return arm

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> dict[str, Any]:
        """What the estimator learns, before training, by name: by default nothing."""
        return {}

    def train(
        self, data: TrainingData, predicted_states: np.ndarray
    ) -> dict[str, Trained]:
        """Learn what the estimator needs to know of the arm: by default nothing.

        Args:
            data: that the forward model was trained on.
            predicted_states: of the trained forward model, along all episodes.
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

    It has no memory.
    """

    def __init__(self, configuration_map: ConfigurationMap, payload: float = 0.0):
        """Compile the map.

        Args:
            configuration_map: from readings to configurations.
            payload: mass at the tip [kg].
        """
        self._map = configuration_map
        # Equinox takes as long to look a method up as the map takes to run
        self._inputs = configuration_map.inputs
        self._configuration = compiled(operator.call, configuration_map)
        self._payload = jnp.asarray(payload, jnp.float32)
        self._knows_payload = payload > 0.0

    @property
    def sensors(self) -> tuple[str, ...]:
        """See `StateEstimator`."""
        return self._map.sensors

    def start(self, reading: Reading) -> Estimate:
        """See `StateEstimator`."""
        configuration = self._configuration(self._inputs(reading))
        if not self._knows_payload:
            return Estimate(configuration)
        biases = jnp.zeros((len(configuration), 2))
        return Estimate(configuration, Disturbances(self._payload, biases))

    def update(
        self, estimate: Estimate, reading: Reading, last_command: Actions
    ) -> Estimate:
        """See `StateEstimator`."""
        configuration = self._configuration(self._inputs(reading))
        return estimate._replace(configuration=configuration)


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
        return EncoderEstimator(configuration_map, settings.known_payload)
