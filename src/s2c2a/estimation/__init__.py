"""State estimation: configuration, payload and bend biases from readings."""

from s2c2a.components import CustomComponent, Registry
from s2c2a.estimation.configuration_maps import (
    CONFIGURATION_MAPS,
    PAPER_COUPLING,
    ConfigurationMap,
    CoupledMap,
    EncoderMap,
    TrueConfigurationMap,
    UnitLengthMap,
    WrappedMap,
    configuration_map_for,
)
from s2c2a.estimation.disturbance_filter import DisturbanceFilter
from s2c2a.estimation.estimate import Estimate
from s2c2a.estimation.estimator import (
    EncoderEstimator,
    EncoderOnly,
    EstimationSettings,
    EstimatorOptions,
    StateEstimator,
)
from s2c2a.estimation.kalman_estimator import (
    MODAL_MODEL,
    KalmanEstimator,
    KalmanFilter,
)
from s2c2a.estimation.modal_model import ModalFactors
from s2c2a.estimation.sensor_models import FormulaSensor, SensorModel

ESTIMATORS: Registry[EstimatorOptions] = Registry(
    "estimator",
    EstimatorOptions,
    {"EncoderOnly": EncoderOnly, "KalmanFilter": KalmanFilter},
)
"""State estimators by name, for `[estimator]` in a recipe."""
