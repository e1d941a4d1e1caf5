"""What a chain for another arm begins with: what was learned, module by module, of an arm of the same make.

A module takes the numbers of those at the same place along the arm. The small network
sees all modules at once and fits no other count of them; one in its place first learns,
without any recording, what the weights of the new arm's modules do, which its
description says.
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
from s2c2a.models.cables import Hysteresis
from s2c2a.models.chain import ChainC2S, ChainMemory
from s2c2a.models.disturbances import Disturbances, moments_of_weights
from s2c2a.models.statics import Equilibrium
from s2c2a.training.trained import TrainingData

SUNK = 30  # times that weights and the shape under them are brought together
NEARER = 0.5  # of the way, each time
_log_stiffness = attrgetter("equilibrium.log_stiffness")


def carried_over(
    chain: ChainC2S, old: ArmSpec, blank: ChainC2S, new: ArmSpec
) -> ChainC2S:
    """The chain of an arm, for another of the same make.

    Args:
        chain: learned.
        old: of which arm.
        blank: an untrained one of the new arm.
        new: that arm.
    """
    places = same_places(old.module_count, new.module_count)
    begun = replace(chain, body=blank.body)
    if old.module_count != new.module_count:
        hysteresis = _hysteresis(chain.hysteresis, places)
        equilibrium = _each(chain.equilibrium, places)
        begun = replace(blank, hysteresis=hysteresis, equilibrium=equilibrium)
    ratio = jnp.asarray(
        np.log(_stiffness(new) / (places @ _stiffness(old))), jnp.float32
    )
    return eqx.tree_at(_log_stiffness, begun, _log_stiffness(begun) + ratio)


def same_places(old: int, new: int) -> Float[np.ndarray, "new old"]:
    """What of each old module a new one takes: that at the same part of the way from first to last, or its neighbors'.

    Rows sum up to one.
    """
    place = (
        np.linspace(0.0, old - 1.0, new) if new > 1 else np.array([(old - 1.0) / 2.0])
    )
    return np.maximum(1.0 - np.abs(place[:, None] - np.arange(old)), 0.0)


def _stiffness(arm: ArmSpec) -> Float[np.ndarray, " modules"]:
    """Of the cables, over that of the modules, as described; one where motors pull with a force."""
    springs = ArmGeometry.of(arm).cable_springs
    own = np.array([module.bending_stiffness / module.length for module in arm.modules])
    return springs / own if springs.all() else np.ones(len(own))


def _hysteresis(
    hysteresis: Hysteresis, places: Float[np.ndarray, "new old"]
) -> Hysteresis:
    """Of other modules: no cable is another's, so each takes the mean of its module's."""
    plays = jnp.log(jnp.expm1(_mixed(jax.nn.softplus(hysteresis.play_weights), places)))
    return replace(
        hysteresis,
        play_weights=plays,
        creep_weights=_mixed(hysteresis.creep_weights, places),
    )


def _mixed(
    weights: Float[Array, "old inputs cables"], places: Float[np.ndarray, "new old"]
) -> Array:
    alike = jnp.broadcast_to(weights.mean(axis=-1, keepdims=True), weights.shape)
    return jnp.einsum("no,oic->nic", places, alike)


def _each(
    equilibrium: Equilibrium, places: Float[np.ndarray, "new old"]
) -> Equilibrium:
    return jax.tree.map(
        lambda values: jnp.tensordot(jnp.asarray(places, values.dtype), values, 1),
        equilibrium,
    )


@eqx.filter_jit
def under_weights(
    chain: ChainC2S, inputs: Float[Array, "samples modules inputs cables"]
) -> Array:
    """States of modules that sink under their own weights as described, shape (samples, modules, 6).

    Of a chain whose network does not know of weights.
    """

    def sunk(inputs: Array) -> Array:
        modules = len(chain.body.lengths)

        def deeper(_, hung: Array) -> Array:
            rest, lengths, _ = chain._at_rest(inputs, hung)
            body = chain.body
            weighed = moments_of_weights(
                body.weights, rest.bends, lengths, body.compliances, body.gravity
            )
            return hung + NEARER * (weighed - hung)

        hung = jax.lax.fori_loop(0, SUNK, deeper, jnp.zeros((modules, 2)))
        return chain.states(
            inputs,
            ChainMemory(None, Disturbances.none(modules), hung, hung),  # type: ignore[arg-type]
        )

    return jax.lax.map(sunk, inputs, batch_size=256)


def babbled(arm: ArmSpec, options: CollectOptions) -> TrainingData:
    """What motors would say while data of an arm driven by displacement are collected; its states stand for nothing.

    Args:
        arm: that is not there.
        options: how data would be collected.
    """
    geometry = ArmGeometry.of(arm)
    told = (options.episodes, options.samples, options.seed, options.speeds)
    episodes = [
        episode_actions(geometry, options.babbling, one, *told)
        for one in range(options.episodes)
    ]
    moved = np.stack(episodes) / geometry.cable_radii[:, None]
    bends = np.einsum("mkn,...mn->...mk", geometry.bend_matrices, moved)
    sensed = np.asarray(configurations_from_bends(jnp.asarray(bends, jnp.float32)))
    return TrainingData(
        arm, sensed, np.stack(episodes), np.zeros((*sensed.shape[:-1], 6))
    )
