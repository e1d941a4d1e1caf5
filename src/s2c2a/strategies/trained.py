"""Trained networks of an arm, from which a strategy is built."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.models.forward_model import ForwardModel
from s2c2a.strategies.recipe import Recipe
from s2c2a.training import Trained


@dataclass(frozen=True)
class TrainedNetworks:
    """The networks of one strategy.

    Attributes:
        arm: that they were trained for.
        recipe: how they were trained, and how to plan with them.
        seed: of the training.
        networks: pytrees by name, such as "C2S" and "C2A".
        percent: held-out errors, network -> mean and standard deviation [% of the full
            range].
        curves: network -> rows of epoch, training loss, validation loss.
        strategy: name of the strategy.
        strategy_options: numbers of its options class.
        errors: network -> mean errors of the tip [m] on held-out samples, by the kind of
            these samples.
        spread: of a prior: the forward model with the standard deviations of its
            parameters over arms; None for networks of one arm.
    """

    arm: ArmSpec
    recipe: Recipe
    seed: int
    networks: Mapping[str, Any]
    percent: Mapping[str, tuple[float, float]]
    curves: Mapping[str, np.ndarray]
    strategy: str = "s2c2a"
    strategy_options: Mapping[str, Any] = field(default_factory=dict)
    errors: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    spread: Any = None

    @classmethod
    def of(
        cls,
        arm: ArmSpec,
        recipe: Recipe,
        seed: int,
        trained: Mapping[str, Trained],
    ) -> "TrainedNetworks":
        """Networks from the results of their trainings."""
        empty = cls(arm, recipe, seed, {}, {}, {})
        return empty.with_trained(trained, recipe)

    def with_trained(
        self, trained: Mapping[str, Trained], recipe: Recipe
    ) -> "TrainedNetworks":
        """The same, with some networks trained by a recipe."""
        networks = dict(self.networks)
        percent = dict(self.percent)
        curves = dict(self.curves)
        errors = dict(self.errors)
        for name, result in trained.items():
            networks[name] = result.network
            percent[name] = result.percent
            curves[name] = result.curve
            if result.errors:
                errors[name] = result.errors
        return replace(
            self,
            recipe=recipe,
            networks=networks,
            percent=percent,
            curves=curves,
            errors=errors,
            spread=trained["C2S"].spread if "C2S" in trained else self.spread,
        )

    @property
    def c2s(self) -> ForwardModel:
        """The forward model of the strategy `s2c2a`."""
        return self.networks["C2S"]

    @property
    def c2a(self) -> Any:
        """The controller's network of the strategy `s2c2a`."""
        return self.networks["C2A"]
