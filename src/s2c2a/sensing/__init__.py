"""From readings to rough configurations. Here NumPy turns into JAX."""

from s2c2a.sensing.estimators import (
    ESTIMATORS,
    PAPER_COUPLING,
    CoupledEstimator,
    DirectionEstimator,
    EncoderEstimator,
    Estimator,
    TrueEstimator,
    estimator_for,
)
