"""Prior over arms: mean and spread of a model's parameters (empirical Bayes).

Models of several arms, all trained from one joint model, stay comparable parameter by
parameter. Their mean is where the training of a further arm starts. Their standard
deviation states how much each parameter differs between arms, and so how far few samples
of an arm may change it.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from s2c2a.errors import TrainingError
from s2c2a.training.fit import Network, is_fixed
from s2c2a.training.trained import TrainingData

MIN_ARMS = 2
MIN_SPREAD = 1e-4
"""Smallest standard deviation of a parameter, since few arms underestimate it."""


def pooled(arms: Sequence[TrainingData]) -> TrainingData:
    """The episodes of several arms as training data of the first one.

    Args:
        arms: training data with episodes of one shape.

    Raises:
        TrainingError: fewer than two arms, or arms of different shapes.
    """
    if len(arms) < MIN_ARMS:
        raise TrainingError(
            f"a prior needs recordings of at least {MIN_ARMS} arms and got {len(arms)}; "
            "record more arms"
        )
    shapes = {data.states.shape[1:] for data in arms}
    if len(shapes) > 1:
        raise TrainingError(
            f"episodes of the shapes {sorted(shapes)} do not form one prior; record all "
            "arms with the same options"
        )
    lengths: list[int] = []
    for data in arms:
        episodes, samples = data.states.shape[:2]
        lengths += data.lengths or (samples,) * episodes
    # of all arms, or of none
    displacements = [data.displacements for data in arms]
    known = [values for values in displacements if values is not None]
    return replace(
        arms[0],
        sensed=np.concatenate([data.sensed for data in arms]),
        actions=np.concatenate([data.actions for data in arms]),
        states=np.concatenate([data.states for data in arms]),
        lengths=tuple(lengths),
        displacements=np.concatenate(known) if len(known) == len(arms) else None,
    )


def mean_and_spread(models: Sequence[Network]) -> tuple[Network, Network]:
    """Mean and standard deviation over models, parameter by parameter.

    Fixed parts are those of the first model.

    Args:
        models: of equal shapes.

    Returns:
        A model of the means, and a model of the standard deviations, each at least
        `MIN_SPREAD`.
    """
    mean = jax.tree.map(partial(_over, jnp.mean), *models, is_leaf=is_fixed)
    spread = jax.tree.map(partial(_over, _spread), *models, is_leaf=is_fixed)
    return mean, spread


def _over(statistic: Any, first: Any, *others: Any) -> Any:
    """A statistic of a parameter over models; a fixed part is that of the first."""
    if not eqx.is_inexact_array(first):
        return first
    return statistic(jnp.stack([first, *others]), axis=0)


def _spread(values: Any, axis: int) -> Any:
    return jnp.maximum(jnp.std(values, axis=axis), MIN_SPREAD)
