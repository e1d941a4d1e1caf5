"""Networks of one arm for another of the same make: other drawn mismatch, other numbers, other module counts."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax

from s2c2a.arm import ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.estimation import PREFIX
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import FitOptions

LONGER = 2  # times as many epochs
MAKE = (
    "actuation",
    "cable_count",
    "sensing",
    "sensing_coupling",
    "coupled_cables",
    "control_rate",
)
"""What arms of one make share: what motors are told, what tells how modules bend, and
how long a step is."""


def transferred(
    networks: TrainedNetworks[Recipe], arm: ArmSpec, seed: int = 0
) -> TrainedNetworks[Recipe]:
    """What was learned of one arm, put to work on another, without anything recorded of that one.

    With as many modules nothing changes but what the description says. With others each
    module begins with what was learned at the same place along the arm
    (docs/transfer.md). Held-out errors and curves are those of the old arm.

    Args:
        networks: trained.
        arm: of the same make.
        seed: of everything random.

    Raises:
        StrategyError: the arms are not alike.
        TrainingError: the forward model begins from nothing.
    """
    recipe = networks.recipe
    old = recipe.felt(networks.arm)
    new = recipe.felt(arm)
    check_alike(old, new)
    babbling = recipe.collect_options(seed)
    key = jax.random.key(seed)
    forward = recipe.c2s.carried(networks.c2s, old, new, babbling, key)
    carried = {**networks.networks, "C2S": forward, "C2A": networks.c2a.for_arm(new)}
    kept, percent, curves = (
        _without_sensors(table)
        for table in (carried, networks.percent, networks.curves)
    )
    return replace(
        networks, arm=arm, seed=seed, networks=kept, percent=percent, curves=curves
    )


def _without_sensors(table: Mapping[str, Any]) -> dict[str, Any]:
    """Sensors that had to be learned are another arm's own."""
    return {name: value for name, value in table.items() if not name.startswith(PREFIX)}


def longer(fit: FitOptions) -> FitOptions:
    """A short recording has few batches in an epoch: more of them."""
    return replace(
        fit, max_epochs=LONGER * fit.max_epochs, patience=LONGER * fit.patience
    )


def check_alike(old: ArmSpec, new: ArmSpec) -> None:
    """Raise StrategyError where what was learned of one arm says nothing of another."""
    for key in MAKE:
        theirs = getattr(old, key)
        ours = getattr(new, key)
        if theirs != ours:
            raise StrategyError(
                f"'{new.name}' has {key} {ours!r}, '{old.name}', whose networks were given, {theirs!r}: "
                "nothing carries over; collect a whole recording and train without --from"
            )


def check_same_training(networks: TrainedNetworks[Recipe], recipe: Recipe) -> None:
    """Raise StrategyError where networks have other shapes, or were made for other sensors, than a recipe's."""
    theirs = networks.recipe
    ours = recipe
    parts = ("c2s", "c2a", "directions", "observes")
    if differing := [
        part for part in parts if getattr(theirs, part) != getattr(ours, part)
    ]:
        raise StrategyError(
            f"recipe '{ours.name}' differs in {', '.join(differing)} from '{theirs.name}', by which the networks to "
            f"begin from were trained; take --recipe {theirs.name}, or one that differs elsewhere"
        )
