"""State estimators by name."""

from s2c2a.components import Registry
from s2c2a.estimation.estimator import EncoderOnly, EstimatorOptions
from s2c2a.estimation.kalman_estimator import KalmanFilter

ESTIMATORS: Registry[EstimatorOptions] = Registry(
    "estimator",
    EstimatorOptions,
    {"EncoderOnly": EncoderOnly, "KalmanFilter": KalmanFilter},
)
"""State estimators by name, for `[estimator]` in a recipe."""
