"""What a forward model is made of, as recipes say it; the door for models of others."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from jaxtyping import PRNGKeyArray
from pydantic import ConfigDict

from s2c2a.arm import ArmSpec
from s2c2a.kinematics import ForwardModel
from s2c2a.training import FitOptions, Progress, Trained, TrainingData, quiet


@dataclass(frozen=True)
class ForwardOptions(ABC):
    """The numbers of a forward model, and how a model comes of them.

    A frozen dataclass below this one is all that a model of one's own needs. A recipe file names it, and gives its
    numbers: `[c2s]`, `model = "my_model.py:MyOptions"`, and a line for each (docs/extending.md).

    Attributes:
        model: the name by which recipes find this class.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    model: str = field(default="", kw_only=True)

    @abstractmethod
    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ForwardModel:
        """The model before training.

        Files are read into it: options and arm alone decide how many arrays it has, and their shapes.
        """

    @abstractmethod
    def train(
        self, data: TrainingData, fit: FitOptions, key: PRNGKeyArray, progress: Progress = quiet
    ) -> Trained[ForwardModel]:
        """The model trained.

        Args:
            data: to learn from.
            fit: how to train.
            key: of everything random.
            progress: told epoch, most epochs, validation loss.

        Raises:
            TrainingError: too few samples, or the loss is not finite.
        """
