from .fit import FitOptions, Fixed, FromArm, TrainingProgress, quiet
from .trained import Trained, TrainingData, train

__all__ = [
    "FitOptions",
    "Fixed",
    "FromArm",
    "Trained",
    "TrainingData",
    "TrainingProgress",
    "quiet",
    "train",
]
