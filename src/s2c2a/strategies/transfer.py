"""Transfer of networks to another arm of the same make."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax

from s2c2a.arm import ArmSpec
from s2c2a.errors import StrategyError
from s2c2a.estimation.sensor_models import PREFIX
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import FitOptions

EPOCH_FACTOR = 2
"""A short recording has few batches in an epoch: it takes more epochs."""
MAKE = (
    "actuation",
    "cable_count",
    "sensing",
    "sensing_coupling",
    "coupled_cables",
    "control_rate",
)
"""Properties that arms of one make share."""


def transferred(
    networks: TrainedNetworks, arm: ArmSpec, seed: int = 0
) -> TrainedNetworks:
    """Networks for another arm, without a recording of it.

    With the same number of modules, only what follows from the arm file changes. With
    another number, each module starts with what was learned at the same place along the
    arm (docs/guides/transfer.md). Held-out errors and learning curves stay those of the old arm.
    A prior stays one with the same number of modules.

    Args:
        networks: trained.
        arm: of the same make.
        seed: of everything random.

    Raises:
        StrategyError: the arms are of different makes.
        TrainingError: the forward model does not transfer.
    """
    recipe = networks.recipe
    old = recipe.seen_arm(networks.arm)
    new = recipe.seen_arm(arm)
    check_same_make(old, new)
    babbling = recipe.collect_options(seed)
    c2s = recipe.c2s.adapted(networks.c2s, old, new, babbling, jax.random.key(seed))
    c2a = recipe.c2a.for_arm(networks.c2a, new)
    same_count = old.module_count == new.module_count
    return replace(
        networks,
        arm=arm,
        seed=seed,
        networks=_without_sensors({**networks.networks, "C2S": c2s, "C2A": c2a}),
        percent=_without_sensors(networks.percent),
        curves=_without_sensors(networks.curves),
        errors={},
        spread=networks.spread if same_count else None,
    )


def _without_sensors(table: Mapping[str, Any]) -> dict[str, Any]:
    """Drop learned sensors: they belong to the other arm."""
    return {name: value for name, value in table.items() if not name.startswith(PREFIX)}


def longer(fit: FitOptions) -> FitOptions:
    """Training options for a short recording."""
    return replace(
        fit,
        max_epochs=EPOCH_FACTOR * fit.max_epochs,
        patience=EPOCH_FACTOR * fit.patience,
    )


def check_same_make(old: ArmSpec, new: ArmSpec) -> None:
    """Refuse arms between which nothing transfers.

    Raises:
        StrategyError: a property in `MAKE` differs.
    """
    for key in MAKE:
        if getattr(old, key) != getattr(new, key):
            raise StrategyError(
                f"'{new.name}' has {key} {getattr(new, key)!r}, and the networks are of "
                f"'{old.name}' with {getattr(old, key)!r}: they do not transfer; collect "
                "a whole recording and train without --from"
            )


def check_same_training(networks: TrainedNetworks, recipe: Recipe) -> None:
    """Refuse networks whose shapes or sensors differ from those of a recipe.

    Raises:
        StrategyError: they differ.
    """
    start = networks.recipe.by_class
    wanted = recipe.by_class
    differing = [
        name
        for name in ("c2s", "c2a", "unit_length", "encoders_alone")
        if getattr(start, name) != getattr(wanted, name)
    ]
    if start.estimator.name != recipe.estimator.name:
        differing.append("estimator")
    if differing:
        raise StrategyError(
            f"recipe '{recipe.name}' differs in {', '.join(differing)} from "
            f"'{start.name}', by which the networks to start from were trained; take "
            f"--recipe {start.name}, or one that differs elsewhere"
        )
