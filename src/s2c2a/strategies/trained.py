"""Trained networks of an arm and how they came about: what strategies are made from, and files keep."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.kinematics import ForwardModel
from s2c2a.models import C2A
from s2c2a.training import Trained

Options = TypeVar("Options")


@dataclass(frozen=True)
class TrainedNetworks(Generic[Options]):
    """The networks of one strategy.

    Attributes:
        arm: what they were trained for.
        recipe: how they were trained, and how to plan with them.
        seed: of the training.
        networks: by name: "C2S" and "C2A", or "LSTM".
        percent: held-out errors, network -> mean and standard deviation [% of full range].
        curves: network -> rows of epoch, training loss, validation loss.
    """

    arm: ArmSpec
    recipe: Options
    seed: int
    networks: Mapping[str, Any]
    percent: Mapping[str, tuple[float, float]]
    curves: Mapping[str, np.ndarray]

    @classmethod
    def of(cls, arm: ArmSpec, recipe: Options, seed: int, trained: Mapping[str, Trained]) -> "TrainedNetworks[Options]":
        """What training says of each network, side by side."""
        said = ({name: getattr(one, part) for name, one in trained.items()} for part in ("network", "percent", "curve"))
        return cls(arm, recipe, seed, *said)

    @property
    def c2s(self) -> ForwardModel:
        """The forward model of the paper's strategy."""
        return self.networks["C2S"]

    @property
    def c2a(self) -> C2A:
        """Its controller."""
        return self.networks["C2A"]
