"""Training: data, trainable and fixed parts of a model, and the training loop."""

from s2c2a.training.fit import FitOptions, Fixed, FromArm, TrainingProgress, fit, quiet
from s2c2a.training.trained import Trained, TrainingData, train
