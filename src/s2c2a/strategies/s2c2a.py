"""The strategy of the paper: C2S in the planner, C2A as the controller.

Trained networks come with the package for both presets, recipe `best`, seed 0;
docs/live.md says how to make them. A file holds what was learned; how plans are made
with it is the recipe's as it is today.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import resources

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.control import Controller, CorrectedController, NetworkController
from s2c2a.data import Recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.estimation import (
    PREFIX,
    Gains,
    Heard,
    Observer,
    Swing,
    gains_of,
    identified_swing,
    learn_numbers,
    learned_sensors,
    sensors_of,
    with_margins,
)
from s2c2a.kinematics import ForwardModel, bends_from_states
from s2c2a.planning import BatchPlanner, Guard, Planner, PlannerOptions
from s2c2a.strategies.recipe import Recipe, recipe_named
from s2c2a.strategies.strategy import Strategy
from s2c2a.strategies.trained import TrainedNetworks, arm_of_strategy, load_strategy
from s2c2a.strategies.transfer import check_same_training, longer, transferred
from s2c2a.training import Trained, TrainingData

FOLDER = resources.files("s2c2a.strategies").joinpath("weights")
MAX_TOLD = 50.0  # kg
TOGETHER = 0.05
"""Of all motion of the cables; less is noise."""


@dataclass(frozen=True)
class Watched:
    """What is known of an arm, and what is done with what it sensors beside its encoders.

    Attributes:
        load: at its tip, as far as it is told [kg].
        estimates: whether load and leans are estimated while it works, or stay as they
            are told.
        yields: to what leans on it: no more than this force at the tip is made up for
            [N]; all of it if None.
    """

    load: float = 0.0
    estimates: bool = True
    yields: float | None = None

    def __post_init__(self):
        """Refuse loads that are none."""
        if not 0.0 <= self.load < MAX_TOLD:
            raise StrategyError(
                f"a load of {self.load} kg was told; say one from 0 to {MAX_TOLD:g} kg"
            )
        if self.yields is not None and not self.yields >= 0.0:
            raise StrategyError(
                f"an arm that yields to {self.yields} N was asked for; say a force from 0, or none"
            )


WATCHED = Watched()
SENSORS = 2  # of what is drawn from a seed
NetworkProgress = Callable[[str, int, int, float], None]


def train_s2c2a(
    recording: Recording,
    recipe: Recipe,
    seed: int,
    progress: NetworkProgress = lambda *_: None,
    start: TrainedNetworks[Recipe] | None = None,
) -> TrainedNetworks[Recipe]:
    """Train both networks on a recording.

    Args:
        recording: with true states; configurations are sensed as the arm file says.
        recipe: sizes and options.
        seed: of everything random.
        progress: told network, epoch, most epochs, validation loss.
        start: networks of another arm of the same make to begin from; a short recording
            will do then.

    Raises:
        RecordingError: episodes are missing or too short, or the recording holds no
            true states.
        StrategyError: the networks to begin from are of another make or recipe.
        TrainingError: too few samples, or the loss is not finite.
    """
    data = training_data(recording, recipe)
    c2s_key, c2a_key = jax.random.split(jax.random.key(seed))
    sensors_key = jax.random.fold_in(jax.random.key(seed), SENSORS)
    # first: they may be too few to learn
    sensors = _sensors(recording, sensors_key, progress) if recipe.observes else {}
    told = _named(progress, "C2S"), _named(progress, "C2A")
    if start is not None:
        check_same_training(start, recipe)
        begun = transferred(start, recording.arm, seed)
        forward = recipe.c2s.go_on(
            begun.c2s, data, longer(recipe.c2s_fit), c2s_key, told[0]
        )
        # motors and swing are no other ones
        return begun.with_trained({"C2S": forward, **sensors}, recipe)
    forward = recipe.c2s.train(data, recipe.c2s_fit, c2s_key, told[0])
    control = recipe.c2a.train(
        data, recipe.history_noise, recipe.c2a_fit, c2a_key, told[1]
    )
    networks: dict[str, Trained] = {"C2S": forward, "C2A": control}
    if recipe.observes:
        networks |= {"swing": _swing(data, recipe, forward.network), **sensors}
    return TrainedNetworks.of(recording.arm, recipe, seed, networks)


def _swing(data: TrainingData, recipe: Recipe, model: ForwardModel) -> Trained[Swing]:
    """How the arm swings about where its model says it rests; errors are in parts of what there is to explain."""
    rests, bends = (
        np.asarray(bends_from_states(jnp.asarray(states, jnp.float32)))
        for states in (recipe.c2s.answers(model, data), data.states)
    )
    swing, (without, left) = identified_swing(data.arm, rests, bends)
    percent = 100.0 * left / without if without > 0 else 100.0
    return Trained(
        swing,
        np.array([[0.0, without, without], [1.0, left, left]], np.float32),
        (percent, 0.0),
    )


def _sensors(
    recording: Recording, key: PRNGKeyArray, progress: NetworkProgress
) -> dict[str, Trained]:
    """What sensors of its arm say of bends, by name; of those that are in the recording, and as they should be."""
    bends = np.asarray(
        bends_from_states(jnp.asarray(recording.sensor("states"), jnp.float32))
    )
    shapes = recording.arm.sensors.learned_shapes(recording.arm.module_count)
    learned = {}
    for name in (one for one in shapes if one in recording.sensors):
        said = recording.sensor(name)
        if said.shape[2:] == shapes[name]:
            heard = Heard.of(bends, said, recording.lengths)
            told = _named(progress, name)
            learned[f"{PREFIX}{name}"] = learn_numbers(recording.arm, heard, key, told)
    return learned


def training_data(recording: Recording, recipe: Recipe) -> TrainingData:
    """What networks of a recipe learn from.

    Raises:
        RecordingError: episodes are missing, or the recording holds no true states, or
            not what its arm sensors.
    """
    recording.check_complete()
    states = recording.sensor("states")
    if not np.isfinite(states).any():
        raise RecordingError(
            "this recording lacks true states, which C2S learns; record with motion capture on"
        )
    sensed = recipe.estimator(recording.arm).sensed(recording.readings())
    if not np.isfinite(sensed).all():
        raise RecordingError(
            "this recording lacks the configurations that its arm sensors; was something not watched?"
        )
    together = moved_together(recording, recipe.felt(recording.arm))
    return TrainingData(
        recipe.felt(recording.arm),
        sensed,
        recording.actions,
        states,
        recording.lengths,
        together,
    )


def moved_together(recording: Recording, arm: ArmSpec) -> np.ndarray | None:
    """Displacements of the cables over their radius [rad], where they tell more than bends: all pulled, or let go.

    None where they were driven as bends, as they are here, or were not measured.
    """
    if (
        arm.actuation != "displacement"
        or arm.sensing != "encoders"
        or "cables" not in recording.sensors
    ):
        return None
    moved = recording.sensor("cables") / ArmGeometry.of(arm).cable_radii[:, None]
    together = moved.mean(axis=-1).std()
    return moved if together > TOGETHER * moved.std() else None


def s2c2a_strategy(
    networks: TrainedNetworks[Recipe], guard: Guard = "tip", watched: Watched = WATCHED
) -> Strategy:
    """Put trained networks to work, planning as their recipe says.

    Args:
        networks: of an arm.
        guard: what keeps out of obstacles.
        watched: what is known of the arm, and what is done with what it sensors.
    """
    arm = networks.arm
    recipe = networks.recipe
    planner = Planner(recipe.felt(arm), networks.c2s, _planner_options(networks, guard))
    controller: Controller = NetworkController(networks.c2a)
    if recipe.correction:
        controller = CorrectedController(controller, recipe.correction)
    observer = observer_of(networks, watched) if recipe.observes else None
    return Strategy(
        "s2c2a", arm, recipe.estimator(arm), planner, controller, observer, watched.load
    )


def observer_of(
    networks: TrainedNetworks[Recipe], watched: Watched = WATCHED
) -> Observer:
    """What watches an arm with trained networks at work."""
    arm = networks.arm
    sensors = (
        *sensors_of(arm, networks.c2s.cable_stiffnesses()),
        *learned_sensors(arm, networks.networks),
    )
    if not sensors:
        return Observer.of(arm, Gains.none(), (), estimates=watched.estimates)
    gains = gains_of(arm, networks.networks.get("swing", Swing.nominal()))
    observer = Observer.of(
        arm,
        gains,
        sensors,
        estimates=watched.estimates,
        yields=np.inf if watched.yields is None else watched.yields,
    )
    return with_margins(arm, observer)


def s2c2a_batch_planner(
    networks: TrainedNetworks[Recipe], guard: Guard = "tip", **sizes: int
) -> BatchPlanner:
    """Plan for many at once with trained networks, as their recipe says.

    Args:
        networks: of an arm.
        guard: what keeps out of obstacles.
        sizes: `chunk` and `threads` (`BatchPlanner`).
    """
    return BatchPlanner(
        networks.recipe.felt(networks.arm),
        networks.c2s,
        _planner_options(networks, guard),
        **sizes,
    )


def shipped_networks(arm: ArmSpec) -> TrainedNetworks:
    """The networks that the package brings for an arm.

    Raises:
        StrategyError: it brings none for this arm.
    """
    for file in sorted(FOLDER.iterdir(), key=lambda one: one.name):
        if file.name.endswith(".safetensors"):
            with resources.as_file(file) as path:
                if arm_of_strategy(path).same_mechanics(arm):
                    networks = load_strategy(path)
                    return replace(
                        networks, arm=arm, recipe=recipe_named(networks.recipe.name)
                    )
    raise StrategyError(
        f"no trained networks come with the package for '{arm.name}'; collect data with `s2c2a collect`, train with "
        "`s2c2a train`, and give the file with --weights"
    )


def planning_as(
    networks: TrainedNetworks[Recipe], recipe: Recipe
) -> TrainedNetworks[Recipe]:
    """The same networks, put to work as another recipe says.

    Raises:
        StrategyError: that recipe trains otherwise.
    """
    if recipe.training != networks.recipe.training:
        raise StrategyError(
            f"recipe '{recipe.name}' trains otherwise than '{networks.recipe.name}', by which these networks were "
            "trained; leave it out, or base one on theirs that differs in its planner alone"
        )
    return replace(networks, recipe=recipe)


def _planner_options(networks: TrainedNetworks[Recipe], guard: Guard) -> PlannerOptions:
    """The recipe's; vectors that sensing coupling mixes are not of unit length unless taken so, and not kept there."""
    options = networks.recipe.planner
    recipe = networks.recipe
    of_unit_length = recipe.directions or networks.arm.sensing_coupling is None
    return replace(options, guard=guard, on_sphere=options.on_sphere and of_unit_length)


def _named(progress: NetworkProgress, network: str):
    return lambda epoch, most, loss: progress(network, epoch, most, loss)
