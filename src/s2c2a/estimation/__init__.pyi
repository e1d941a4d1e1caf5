from .configuration_maps import (
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
from .disturbance_filter import DisturbanceFilter
from .estimate import Estimate
from .estimator import (
    EncoderEstimator,
    EncoderOnly,
    EstimationSettings,
    EstimatorOptions,
    StateEstimator,
)
from .kalman_estimator import MODAL_MODEL, KalmanEstimator, KalmanFilter
from .modal_model import ModalFactors
from .registry import ESTIMATORS
from .sensor_models import FormulaSensor, SensorModel

__all__ = [
    "CONFIGURATION_MAPS",
    "ESTIMATORS",
    "MODAL_MODEL",
    "PAPER_COUPLING",
    "ConfigurationMap",
    "CoupledMap",
    "DisturbanceFilter",
    "EncoderEstimator",
    "EncoderMap",
    "EncoderOnly",
    "Estimate",
    "EstimationSettings",
    "EstimatorOptions",
    "FormulaSensor",
    "KalmanEstimator",
    "KalmanFilter",
    "ModalFactors",
    "SensorModel",
    "StateEstimator",
    "TrueConfigurationMap",
    "UnitLengthMap",
    "WrappedMap",
    "configuration_map_for",
]
