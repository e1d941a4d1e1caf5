"""The strategy of the paper: C2S in the planner, C2A as the controller."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import equinox as eqx
import jax
import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.control import Controller, CorrectedController, NetworkController
from s2c2a.data import Recording, controller_samples, forward_samples
from s2c2a.errors import RecordingError
from s2c2a.kinematics import ForwardModel
from s2c2a.networks import C2A, C2S, ChainC2S, ChainSize
from s2c2a.planning import AnyPlannerOptions, BatchPlanner, Planner, PlannerOptions
from s2c2a.planning.options import Guard
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.scale import planning_scale
from s2c2a.strategies.strategy import Strategy
from s2c2a.training import train_c2a, train_c2s
from s2c2a.training.chain import train_chain_c2s
from s2c2a.training.networks import Trained

NetworkProgress = Callable[[str, int, int, float], None]


@dataclass(frozen=True)
class TrainedNetworks:
    """The two networks of an arm and how they came about.

    Attributes:
        arm: what they were trained for.
        recipe: how they were trained, and how to plan with them.
        seed: of the training.
        c2s: forward model.
        c2a: controller.
        percent: held-out errors, network -> mean and standard deviation [% of full range].
        curves: network -> rows of epoch, training loss, validation loss.
    """

    arm: ArmSpec
    recipe: Recipe
    seed: int
    c2s: ForwardModel
    c2a: C2A
    percent: dict[str, tuple[float, float]]
    curves: dict[str, np.ndarray]


def train_s2c2a(
    recording: Recording, recipe: Recipe, seed: int, progress: NetworkProgress = lambda *_: None
) -> TrainedNetworks:
    """Train both networks on a recording.

    Args:
        recording: with true states; configurations are sensed as the arm file says.
        recipe: sizes and options.
        seed: of everything random.
        progress: told network, epoch, most epochs, validation loss.

    Raises:
        RecordingError: episodes are missing or too short, or the recording holds no true states.
        TrainingError: too few samples, or the loss is not finite.
    """
    recording.check_complete()
    if not np.isfinite(recording.states).all():
        raise RecordingError("this recording lacks true states, which C2S learns; record with motion capture on")
    arm = recording.arm
    sensed = np.asarray(recipe.estimator(arm)(recording.cables, recording.configurations))
    if not np.isfinite(sensed).all():
        raise RecordingError("this recording lacks the configurations that its arm senses; was something not watched?")
    c2s_key, c2a_key = jax.random.split(jax.random.key(seed))
    forward = _train_forward(sensed, recording.states, arm, recipe, c2s_key, _named(progress, "C2S"))
    control = train_c2a(
        controller_samples(sensed, recording.actions, ArmGeometry.of(arm).action_neutral),
        arm,
        recipe.c2a,
        recipe.history_noise,
        recipe.c2a_fit,
        c2a_key,
        _named(progress, "C2A"),
    )
    both: dict[str, Trained[Any]] = {"C2S": forward, "C2A": control}
    return TrainedNetworks(
        arm,
        recipe,
        seed,
        forward.network,
        control.network,
        percent={name: trained.percent for name, trained in both.items()},
        curves={name: trained.curve for name, trained in both.items()},
    )


def s2c2a_strategy(networks: TrainedNetworks, guard: Guard = "tip") -> Strategy:
    """Put trained networks to work, planning as their recipe says.

    Args:
        networks: of an arm.
        guard: what keeps out of obstacles.
    """
    arm, recipe = networks.arm, networks.recipe
    planner = Planner(arm, networks.c2s, planning_scale(arm), _planner_options(networks, guard))
    controller: Controller = NetworkController(networks.c2a)
    if recipe.correction:
        controller = CorrectedController(controller, recipe.correction)
    return Strategy("s2c2a", arm, recipe.estimator(arm), planner, controller)


def s2c2a_batch_planner(networks: TrainedNetworks, guard: Guard = "tip", **sizes: int) -> BatchPlanner:
    """Plan for many at once with trained networks, as their recipe says.

    Args:
        networks: of an arm.
        guard: what keeps out of obstacles.
        sizes: `chunk` and `threads` (`BatchPlanner`).
    """
    options = _planner_options(networks, guard)
    return BatchPlanner(networks.arm, networks.c2s, planning_scale(networks.arm), options, **sizes)


def _planner_options(networks: TrainedNetworks, guard: Guard) -> AnyPlannerOptions:
    """The recipe's; under sensing coupling the paper's configurations are not of unit length, so not kept there."""
    options = replace(networks.recipe.planner, guard=guard)
    if isinstance(options, PlannerOptions) and networks.arm.sensing_coupling is not None:
        options = replace(options, on_sphere=False)
    return options


@eqx.filter_jit
def blank_networks(arm: ArmSpec, recipe: Recipe) -> tuple[ForwardModel, C2A]:
    """Networks of the right shapes for an arm, to be filled; one program, for else each array would be one."""
    key = jax.random.key(0, impl="rbg")  # the numbers do not matter, and this kind compiles fastest
    if isinstance(recipe.c2s, ChainSize):
        forward: ForwardModel = ChainC2S.untrained(arm, recipe.c2s, key)
    else:
        forward = C2S.untrained(**asdict(recipe.c2s), key=key)
    return forward, C2A.untrained(arm, **asdict(recipe.c2a), key=key)


def _train_forward(sensed, states, arm: ArmSpec, recipe: Recipe, key, progress) -> Trained[Any]:
    """The recipe's forward model."""
    if isinstance(recipe.c2s, ChainSize):
        return train_chain_c2s(sensed, states, arm, recipe.c2s, recipe.c2s_fit, key, progress)
    return train_c2s(forward_samples(sensed, states), recipe.c2s, recipe.c2s_fit, key, progress)


def _named(progress: NetworkProgress, network: str):
    return lambda epoch, most, loss: progress(network, epoch, most, loss)
