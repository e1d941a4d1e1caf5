"""State estimators by name."""

from s2c2a.estimation.estimator import EncoderOnly, EstimatorOptions
from s2c2a.estimation.kalman_estimator import KalmanFilter
from s2c2a.plugins.components import Registry

ESTIMATORS: Registry[EstimatorOptions] = Registry(
    "estimator",
    EstimatorOptions,
    {"EncoderOnly": EncoderOnly, "KalmanFilter": KalmanFilter},
)
"""State estimators by name, for `[estimator]` in a recipe."""
