"""Transfer of a trained chain to another arm of the same make, module by module.

Each module takes the parameters of the modules at the same position along the old arm.
The small network has all modules as input and does not fit another module count; its
replacement is pretrained without recordings on the effect of gravity, from the masses
in the arm file.
"""

from dataclasses import replace
from operator import attrgetter

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import CollectOptions
from s2c2a.data.babbling import episode_actions
from s2c2a.kinematics import configurations_from_bends
from s2c2a.models.cables import Hysteresis, Viscoelasticity
from s2c2a.models.chain import ChainC2S
from s2c2a.models.disturbances import Disturbances, moments_of_weights
from s2c2a.models.statics import Equilibrium
from s2c2a.training.trained import TrainingData

SAG_ITERATIONS = 30  # of moments of gravity and the shape under them
SAG_STEP = 0.5  # relaxation factor of these iterations
_log_stiffness = attrgetter("equilibrium.log_stiffness")


def transfer_chain(
    chain: ChainC2S, old: ArmSpec, blank: ChainC2S, new: ArmSpec
) -> ChainC2S:
    """The chain of an arm as initial model of another arm of the same make.

    Args:
        chain: trained.
        old: the arm of `chain`.
        blank: an untrained chain of the new arm.
        new: the new arm.
    """
    places = interpolation_weights(old.module_count, new.module_count)
    initial = replace(chain, body=blank.body)
    if old.module_count != new.module_count:
        hysteresis = _interpolate_hysteresis(chain.hysteresis, places)
        equilibrium = _interpolate(chain.equilibrium, places)
        initial = replace(blank, hysteresis=hysteresis, equilibrium=equilibrium)
    ratio = np.log(_relative_stiffness(new) / (places @ _relative_stiffness(old)))
    log_stiffness = _log_stiffness(initial) + jnp.asarray(ratio, jnp.float32)
    return eqx.tree_at(_log_stiffness, initial, log_stiffness)


def interpolation_weights(old: int, new: int) -> Float[np.ndarray, "new old"]:
    """Linear interpolation weights from old to new modules, by position along the arm.

    Rows sum up to one.
    """
    middle = (old - 1.0) / 2.0
    positions = np.linspace(0.0, old - 1.0, new) if new > 1 else np.array([middle])
    return np.maximum(1.0 - np.abs(positions[:, None] - np.arange(old)), 0.0)


def _relative_stiffness(arm: ArmSpec) -> Float[np.ndarray, " modules"]:
    """Nominal stiffness of cables over that of modules; one on a tension arm."""
    springs = ArmGeometry.of(arm).cable_springs
    if not springs.all():
        return np.ones(arm.module_count)
    own = np.array([module.bending_stiffness / module.length for module in arm.modules])
    return springs / own


def _interpolate_hysteresis(
    hysteresis: Hysteresis, places: Float[np.ndarray, "new old"]
) -> Hysteresis:
    """Each cable takes the mean of its module, since cables do not correspond."""
    plays = _interpolate_means(jax.nn.softplus(hysteresis.play_weights), places)
    creep = _interpolate_means(hysteresis.creep.weights, places)
    return replace(
        hysteresis,
        play_weights=jnp.log(jnp.expm1(plays)),
        delay_weights=_interpolate_means(hysteresis.delay_weights, places),
        creep=Viscoelasticity.from_weights(creep),
    )


def _interpolate_means(
    weights: Float[Array, "old inputs cables"], places: Float[np.ndarray, "new old"]
) -> Array:
    means = jnp.broadcast_to(weights.mean(axis=-1, keepdims=True), weights.shape)
    return jnp.einsum("no,oic->nic", places, means)


def _interpolate(
    equilibrium: Equilibrium, places: Float[np.ndarray, "new old"]
) -> Equilibrium:
    def interpolate(values: Array) -> Array:
        return jnp.tensordot(jnp.asarray(places, values.dtype), values, 1)

    return jax.tree.map(interpolate, equilibrium)


@eqx.filter_jit
def states_under_gravity(
    chain: ChainC2S, inputs: Float[Array, "samples modules inputs cables"]
) -> Array:
    """States of an arm under gravity, for a chain whose network ignores gravity.

    Args:
        chain: holds the nominal masses.
        inputs: of the hysteresis (`Hysteresis.inputs`).

    Returns:
        States [m, 1], shape (samples, modules, 6), base frame.
    """
    body = chain.body
    modules = len(body.lengths)

    def sag(inputs: Array) -> Array:
        def iterate(_, moments: Array) -> Array:
            rest, lengths, _ = chain._at_rest(inputs, moments)
            target = moments_of_weights(
                body.weights, rest.bends, lengths, body.compliances, body.gravity
            )
            return moments + SAG_STEP * (target - moments)

        none = jnp.zeros((modules, 2))
        moments = jax.lax.fori_loop(0, SAG_ITERATIONS, iterate, none)
        undisturbed = Disturbances.none(modules)
        return chain.states(inputs, undisturbed._replace(moments=moments))

    return jax.lax.map(sag, inputs, batch_size=256)


def babbling_data(arm: ArmSpec, options: CollectOptions) -> TrainingData:
    """Generated encoder readings of motor babbling with displacement actuation.

    Args:
        arm: the arm.
        options: of the data collection.

    Returns:
        Training data whose states are zero and meaningless.
    """
    geometry = ArmGeometry.of(arm)
    actions = []
    for number in range(options.episodes):
        episode = episode_actions(
            geometry,
            options.babbling,
            number,
            options.episodes,
            options.samples,
            options.seed,
            options.speeds,
        )
        actions.append(episode)
    stacked = np.stack(actions)
    displacements = stacked / geometry.cable_radii[:, None]
    bends = geometry.bends_of(displacements)
    sensed = np.asarray(configurations_from_bends(jnp.asarray(bends, jnp.float32)))
    states = np.zeros((*sensed.shape[:-1], 6))
    return TrainingData(arm, sensed, stacked, states)
