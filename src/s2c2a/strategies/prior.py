"""A prior over arms of one make, from recordings of randomized ones."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import jax

from s2c2a.arm import ArmSpec
from s2c2a.data import Recording
from s2c2a.errors import StrategyError, counted
from s2c2a.estimation.sensor_models import PREFIX
from s2c2a.models.prior import pooled
from s2c2a.strategies.options import NetworkProgress
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.s2c2a import training_data, with_controller
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import TrainingData
from s2c2a.training.fit import random_key


def pretrain_s2c2a(
    recordings: Sequence[Recording],
    arm: ArmSpec,
    recipe: Recipe,
    seed: int,
    progress: NetworkProgress = lambda *_: None,
) -> TrainedNetworks:
    """Networks to start from, with the spread of their parameters over arms.

    The forward model is the mean over arms. The controller and the modal model are
    trained on episodes of all arms together, as many as the recipe records of one.
    Sensor models belong to one arm and are not part of a prior.

    Args:
        recordings: of each arm, with true states and equal options.
        arm: nominal arm that all of them are variants of.
        recipe: sizes and options.
        seed: of everything random.
        progress: called with network, epoch, number of epochs, validation loss.

    Raises:
        RecordingError: episodes are missing, or without true states.
        StrategyError: an arm has another number of modules.
        TrainingError: the forward model has no prior, or training failed.
    """
    c2s_key, c2a_key = jax.random.split(random_key(seed))
    seen_arm = recipe.seen_arm(arm)
    arms = []
    for recording in recordings:
        recorded = recording.arm
        if recorded.module_count != arm.module_count:
            raise StrategyError(
                f"'{recorded.name}' has {counted(recorded.module_count, 'module')} and "
                f"'{arm.name}' {arm.module_count}; record randomized variants of '{arm.name}'"
            )
        arms.append(replace(training_data(recording, recipe), arm=seen_arm))
    c2s_progress = partial(progress, "C2S")
    prior = recipe.c2s.pretrain(arms, recipe.c2s_fit, c2s_key, c2s_progress)
    some = _every_nth_episode(pooled(arms), recipe.episodes)
    whole = with_controller(prior, some, recipe, c2a_key, progress)
    trained = {name: whole[name] for name in whole if not name.startswith(PREFIX)}
    return TrainedNetworks(arm, recipe, seed, trained)


def _every_nth_episode(data: TrainingData, count: int) -> TrainingData:
    """At most so many episodes, from all arms in turn."""
    step = max(1, len(data.states) // count)
    chosen = slice(0, step * count, step)
    by_episode = {
        name: values[chosen]
        for name, values in vars(data).items()
        if name != "arm" and values is not None
    }
    return replace(data, **by_episode)
