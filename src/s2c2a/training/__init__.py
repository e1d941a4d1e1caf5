"""Training: what a model learns from, what of it is learned, and the one loop."""

from s2c2a.training.data import TrainingData
from s2c2a.training.fit import FitOptions, Progress, fit, quiet
from s2c2a.training.learned import Fixed, FromArm
from s2c2a.training.trained import Trained, train
