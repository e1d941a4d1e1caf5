"""The strategy of the paper: C2S in the planner, C2A as the controller.

Networks for both presets come with the package (recipe `best`, seed 0); docs/guides/live.md
describes their training. A file contains what was learned; the recipe defines how to plan
with it.
"""

from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from typing import Any

import jax
import numpy as np
from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.randomized import without_mismatch
from s2c2a.control import Controller, CorrectedController
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import RecordingError, StrategyError, counted, listed
from s2c2a.estimation import MODAL_MODEL, EstimationSettings, StateEstimator
from s2c2a.planning import Guard, Planner
from s2c2a.strategies.options import (
    RECIPE_KEYS,
    NetworkProgress,
    StrategyOptions,
)
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.strategy import Strategy
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import Trained, TrainingData
from s2c2a.training.fit import random_key

WEIGHTS = resources.files("s2c2a.strategies").joinpath("weights")
COMMON_MOTION = 0.05
"""Share of the cables' motion that they make together; a smaller one is noise."""
EPOCH_FACTOR = 2  # times the epochs of a whole recording, for a short one


@dataclass(frozen=True)
class S2C2A(StrategyOptions):
    """State to configuration to action, as the recipe defines it."""

    name = "s2c2a"
    supports = frozenset(
        {"guard", "known_payload", "disturbance_estimation", "max_compensated_force"}
    )

    def training_arm(self, arm: ArmSpec, recipe: Recipe) -> ArmSpec:
        return recipe.seen_arm(arm)

    def collect_options(self, recipe: Recipe, seed: int) -> CollectOptions:
        return recipe.collect_options(seed)

    def training_key(self, recipe: Recipe) -> Any:
        return recipe.training

    def untrained(self, arm, recipe, key) -> dict[str, Any]:
        return recipe.untrained(arm, key)

    def train(self, recording, recipe, seed, progress=lambda *_: None):
        return train_s2c2a(recording, recipe, seed, progress)

    def build(self, arm, recipe, trained, run) -> Strategy:
        if trained is None:
            raise StrategyError("s2c2a needs trained networks")
        networks = replace(trained, arm=arm, recipe=recipe)
        return s2c2a_strategy(networks, run.guard, run.estimation)


@dataclass(frozen=True)
class S2C2AMotor(S2C2A):
    """The same, trained on motor babbling (Chen et al. 2025, sec. IV)."""

    name = "s2c2a-motor"
    recipe_keys = RECIPE_KEYS - {"babbling"}

    def recipe(self, recipe: Recipe) -> Recipe:
        return replace(recipe, babbling="motor")


def train_s2c2a(
    recording: Recording,
    recipe: Recipe,
    seed: int,
    progress: NetworkProgress = lambda *_: None,
    start: TrainedNetworks | None = None,
) -> TrainedNetworks:
    """Train all networks of the strategy on a recording.

    Args:
        recording: with true states; the arm file names the sensor of the configurations.
        recipe: sizes and options.
        seed: of everything random.
        progress: called with network, epoch, number of epochs, validation loss.
        start: a prior over variants of the arm (`pretrain_s2c2a`); then a short
            recording will do.

    Raises:
        RecordingError: episodes are missing or too short, or without true states.
        StrategyError: the networks to start from are no prior, or one of another arm or
            recipe.
        TrainingError: too few samples, or the loss is not finite.
    """
    key = random_key(seed)
    data = training_data(recording, recipe)
    c2s_key, c2a_key = jax.random.split(key)
    sensor_key = jax.random.fold_in(key, 2)  # another key than the two of the split

    c2s_progress = partial(progress, "C2S")
    # first: a recording may hold too few samples of a sensor
    sensors = recipe.estimator_options.train_sensors(recording, sensor_key, progress)
    if start is not None:
        check_prior(start, data.arm, recipe)
        # a short recording has few batches in an epoch
        longer = replace(
            recipe.c2s_fit,
            max_epochs=EPOCH_FACTOR * recipe.c2s_fit.max_epochs,
            patience=EPOCH_FACTOR * recipe.c2s_fit.patience,
        )
        c2s = recipe.c2s.resume_training(
            start.c2s, start.trained["C2S"].spread, data, longer, c2s_key, c2s_progress
        )
        # controller and modal model stay those of the prior
        return replace(
            start,
            arm=recording.arm,
            recipe=recipe,
            seed=seed,
            trained={**start.trained, "C2S": c2s, **sensors},
        )
    c2s = recipe.c2s.train(data, recipe.c2s_fit, c2s_key, c2s_progress)
    trained = with_controller(c2s, data, recipe, c2a_key, progress)
    return TrainedNetworks(recording.arm, recipe, seed, trained | sensors)


def with_controller(
    c2s: Trained,
    data: TrainingData,
    recipe: Recipe,
    key: PRNGKeyArray,
    progress: NetworkProgress,
) -> dict[str, Trained]:
    """A forward model, and the controller and the estimator that are trained beside it."""
    c2a_progress = partial(progress, "C2A")
    c2a = recipe.c2a.train(
        data, recipe.history_noise, recipe.c2a_fit, key, c2a_progress
    )
    predicted = recipe.c2s.predictions(c2s.network, data)
    return {"C2S": c2s, "C2A": c2a, **recipe.estimator_options.train(data, predicted)}


def check_prior(start: TrainedNetworks, arm: ArmSpec, recipe: Recipe) -> None:
    """Refuse networks that training on this arm by this recipe cannot start from.

    Raises:
        StrategyError: they are no prior, or one of another arm or recipe.
    """
    if not start.is_prior:
        raise StrategyError(
            f"the networks to start from are of the one arm '{start.arm.name}'; make a "
            "prior with `s2c2a pretrain`, or train without --from"
        )
    # a prior is of variants, which differ in what controllers do not know
    seen = without_mismatch(start.recipe.seen_arm(start.arm))
    arm = without_mismatch(arm)
    if arm.differences(seen):
        raise StrategyError(
            f"the prior is of '{seen.name}', which differs from '{arm.name}' in "
            f"{listed(seen.differences(arm))}; make one of this arm with "
            f"`s2c2a pretrain`"
        )
    ours = start.recipe.by_class
    wanted = recipe.by_class
    differing = [
        name
        for name in ("c2s", "c2a", "unit_length", "encoders_alone")
        if getattr(ours, name) != getattr(wanted, name)
    ]
    if ours.estimator.name != wanted.estimator.name:
        differing.append("estimator")
    if differing:
        raise StrategyError(
            f"recipe '{recipe.name}' differs in {', '.join(differing)} from "
            f"'{start.recipe.name}', by which the networks to start from were trained; "
            f"take --recipe {start.recipe.name}, or one that differs elsewhere"
        )


def training_data(recording: Recording, recipe: Recipe) -> TrainingData:
    """The data that networks of a recipe are trained on.

    Raises:
        RecordingError: episodes are missing, or true states, or sensed configurations.
    """
    recording.check_complete()
    states = recording.sensor("states")
    if not np.isfinite(states).any():
        raise RecordingError(
            "this recording lacks true states, which C2S learns; record with motion "
            "capture on"
        )
    configuration_map = recipe.configuration_map(recording.arm)
    sensed = configuration_map.configurations(recording.readings())
    missing = np.argwhere(~np.isfinite(sensed).all(axis=(2, 3)))
    if len(missing):
        episode, row = missing[0] + 1
        raise RecordingError(
            f"this recording lacks sensed configurations in {counted(len(missing), 'row')}"
            f", first in row {row} of episode {episode}; record again with all sensors on "
            "(--recipe best needs those of the cables alone)"
        )
    arm = recipe.seen_arm(recording.arm)
    return TrainingData(
        arm,
        sensed,
        recording.actions,
        states,
        recording.lengths,
        common_displacements(recording, arm),
    )


def common_displacements(recording: Recording, arm: ArmSpec) -> np.ndarray | None:
    """Cable displacements over their radius [rad], where cables also move together.

    None where cables move as bends alone, as in data of this package, or were not
    measured.
    """
    if arm.actuation != "displacement" or arm.sensing != "encoders":
        return None
    if "cables" not in recording.sensors:
        return None
    radii = ArmGeometry.of(arm).cable_radii[:, None]
    displacements = recording.sensor("cables") / radii
    common = displacements.mean(axis=-1).std()
    return None if common <= COMMON_MOTION * displacements.std() else displacements


def s2c2a_strategy(
    networks: TrainedNetworks,
    guard: Guard = "tip",
    settings: EstimationSettings = EstimationSettings(),  # noqa: B008  # frozen
) -> Strategy:
    """Build the strategy from trained networks.

    Args:
        networks: of an arm.
        guard: which points are kept out of obstacles.
        settings: what the user states about disturbances.

    Raises:
        StrategyError: the recipe's estimator ignores one of the settings.
    """
    arm = networks.arm
    recipe = networks.recipe
    # configurations of coupled sensors have no unit length
    has_unit_length = recipe.unit_length or arm.sensing_coupling is None
    on_sphere = recipe.planner.on_sphere and has_unit_length
    options = replace(recipe.planner, guard=guard, on_sphere=on_sphere)
    modal_model = networks.networks.get(MODAL_MODEL)
    planner = Planner(recipe.seen_arm(arm), networks.c2s, options, modal_model)
    controller: Controller = recipe.c2a.controller(networks.c2a)
    if recipe.integral_gain:
        controller = CorrectedController(controller, recipe.integral_gain)
    estimator = estimator_of(networks, settings)
    return Strategy("s2c2a", arm, estimator, planner, controller)


def estimator_of(
    networks: TrainedNetworks,
    settings: EstimationSettings = EstimationSettings(),  # noqa: B008  # frozen
) -> StateEstimator:
    """The state estimator of trained networks.

    Raises:
        StrategyError: it ignores one of the settings.
    """
    recipe = networks.recipe
    options = recipe.estimator_options
    settings.check_supported(
        options.supports, f"the estimator {options.name} of recipe '{recipe.name}'"
    )
    return options.build(
        networks.arm,
        recipe.configuration_map(networks.arm),
        networks.c2s,
        networks.networks,
        settings,
    )


def planning_as(networks: TrainedNetworks, recipe: Recipe) -> TrainedNetworks:
    """The same networks, used by another recipe.

    The estimator may differ: it does without what was not trained for it.

    Raises:
        StrategyError: that recipe trains differently.
    """
    ours = networks.recipe.by_class.training | {"estimator": ""}
    if recipe.by_class.training | {"estimator": ""} != ours:
        raise StrategyError(
            f"recipe '{recipe.name}' trains differently from '{networks.recipe.name}', "
            "by which these networks were trained; leave it out, or base one on theirs "
            "that differs in planner and estimator alone"
        )
    return replace(networks, recipe=recipe)
