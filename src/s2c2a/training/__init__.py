"""Training: one loop, two networks, checkpoints."""

from s2c2a.training.errors import percent_error
from s2c2a.training.fit import FitOptions, FitResult, fit
from s2c2a.training.networks import train_c2a, train_c2s

__all__ = ["FitOptions", "FitResult", "fit", "percent_error", "train_c2a", "train_c2s"]
