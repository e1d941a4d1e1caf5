"""Training: what a model learns from, what of it is learned, and the one loop."""

from s2c2a.training.fit import FitOptions, Fixed, FromArm, Progress, fit, quiet
from s2c2a.training.trained import Trained, TrainingData, train
