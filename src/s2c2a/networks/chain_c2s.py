"""The forward model of the `best` recipe: cables with memory, modules at rest, arcs in a row, and what they leave out.

From the wanted configuration to what the cables carry over (`Hysteresis`), from there to the bends at which modules
come to rest (`bend_at_rest`), from bends to states along the chain of arcs. A small network adds what this leaves out:
moments of gravity, bends and end points that arcs do not have.
"""

from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.errors import TrainingError
from s2c2a.kinematics import ForwardModel, bends_from_configurations
from s2c2a.kinematics.chain import states_from_arcs
from s2c2a.kinematics.statics import bend_at_rest
from s2c2a.networks.hysteresis import Hysteresis, HysteresisMemory

BEND_UNIT = 0.5  # rad; inputs of the network are about one
MOMENT_UNIT, BEND_CORRECTION_UNIT = 1.0, 0.2  # rad; an output of one
END_CORRECTION_UNIT = 0.1  # of a module's length
FIRST_STIFFNESS = 4.0  # kappa before training
OUTPUTS = 7  # of every module: moment 2, bend 2, end 3
NO_WEIGHT = -7.0  # before a softplus


@dataclass(frozen=True)
class ChainSize:
    """What the forward model of the `best` recipe is made of.

    Attributes:
        hidden: units of each hidden layer of its network.
        depth: number of hidden layers.
        play_widths: half-widths of plays, in parts of the cable radius [rad]; none, and the model knows no play.
        creep_times: time constants of filters [s].
        statics: whether cables only pull and stretch, where the sensors are motors' encoders; else the network has to
            find out.
    """

    hidden: int = 64
    depth: int = 2
    play_widths: tuple[float, ...] = (0.002, 0.005, 0.011, 0.019, 0.026, 0.033, 0.041, 0.052, 0.067)
    creep_times: tuple[float, ...] = (1.0, 3.0, 10.0)
    statics: bool = True

    def __post_init__(self):
        """Refuse what cannot be built."""
        if not (1 <= self.hidden <= 4096 and 1 <= self.depth <= 32):
            raise TrainingError(
                f"a network of {self.depth} layers of {self.hidden} was asked for; take 1 to 32 of 1 to 4096"
            )
        if not all(value > 0 for value in (*self.play_widths, *self.creep_times)):
            raise TrainingError(f"{self} asked for; widths of plays and times of creep must be positive")


class Body(eqx.Module):
    """What follows from the arm: not learned, not read from files.

    Attributes:
        lengths: of modules [m], shape (modules,).
        matrices: B, shape (modules, cables, 2).
        inverses: of B, shape (modules, 2, cables).
    """

    lengths: Float[Array, " modules"]
    matrices: Float[Array, "modules cables 2"]
    inverses: Float[Array, "modules 2 cables"]

    @classmethod
    def of(cls, arm: ArmSpec) -> "Body":
        """The numbers of an arm."""
        geometry = ArmGeometry.of(arm)
        arrays = geometry.lengths, geometry.cable_matrices, geometry.bend_matrices
        return cls(*(jnp.asarray(array, dtype=jnp.float32) for array in arrays))

    def displacements(self, configurations: Float[Array, "*batch modules 3"]) -> Float[Array, "*batch modules cables"]:
        """What sensed configurations say of the cables, over the cable radius [rad]."""
        return jnp.einsum("mnk,...mk->...mn", self.matrices, bends_from_configurations(configurations))

    def bends(self, displacements: Float[Array, "*batch modules cables"]) -> Float[Array, "*batch modules 2"]:
        """The other way."""
        return jnp.einsum("mkn,...mn->...mk", self.inverses, displacements)


class ChainC2S(ForwardModel):
    """Hysteresis, statics, arcs and a network.

    Attributes:
        body: what follows from the arm.
        hysteresis: of the cables.
        log_stiffness: logarithm of kappa (`bend_at_rest`), shape (modules,).
        tautness: tau, shape (modules,).
        mixing: where there are no statics, what bends all modules' sensed bends stand for, shape
            (2 modules, 2 modules).
        network: what the rest leaves out.
        statics: whether cables only pull.
        engaged: whether slopes are those of taut cables that follow their motors.
    """

    body: Body
    hysteresis: Hysteresis
    log_stiffness: Float[Array, " modules"]
    tautness: Float[Array, " modules"]
    mixing: Float[Array, "bends bends"]
    network: eqx.nn.MLP
    statics: bool = eqx.field(static=True)
    engaged: bool = eqx.field(static=True, default=False)

    @classmethod
    def untrained(cls, arm: ArmSpec, size: ChainSize, key: PRNGKeyArray) -> "ChainC2S":
        """For an arm, before anything is learned: no hysteresis, and a network that says nearly nothing."""
        modules = arm.module_count
        shares = [1.0 - np.exp(-arm.control_period / time) for time in size.creep_times]
        play_weights = jnp.full((modules, len(size.play_widths) + 2), NO_WEIGHT).at[:, 0].set(np.log(np.expm1(1.0)))
        hysteresis = Hysteresis(
            jnp.asarray(size.play_widths, dtype=jnp.float32).reshape(-1),
            jnp.asarray(shares, dtype=jnp.float32).reshape(-1),
            play_weights,
            jnp.zeros((modules, len(shares))),
        )
        statics = size.statics and _is_felt_through_cables(arm)
        features = modules * (2 + arm.cable_count if statics else 2)
        network = eqx.nn.MLP(features, OUTPUTS * modules, size.hidden, size.depth, jax.nn.tanh, key=key)
        head = network.layers[-1]
        quiet = (0.01 * head.weight, jnp.zeros(head.weight.shape[0]))
        network = eqx.tree_at(lambda net: (net.layers[-1].weight, net.layers[-1].bias), network, quiet)
        stiffness = jnp.full(modules, np.log(FIRST_STIFFNESS))
        return cls(
            Body.of(arm), hysteresis, stiffness, jnp.zeros(modules), jnp.eye(2 * modules), network, bool(statics)
        )

    def for_planning(self) -> "ChainC2S":
        """The same predictions with the slopes of taut cables that follow their motors."""
        return replace(self, hysteresis=replace(self.hysteresis, engaged=True), engaged=True)

    def start(self, sensed: Float[Array, "*batch modules 3"]) -> HysteresisMemory:
        """See `ForwardModel`."""
        return self.hysteresis.start(self.body.displacements(sensed))

    def observe(self, sensed: Float[Array, "*batch modules 3"], memory: HysteresisMemory) -> HysteresisMemory:
        """See `ForwardModel`."""
        return self.hysteresis.advance(self.body.displacements(sensed), memory)

    def predict(self, configurations: Float[Array, "*batch modules 3"], memory: HysteresisMemory) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""
        return self.states(self.hysteresis.inputs(self.body.displacements(configurations), memory))

    def states(self, inputs: Float[Array, "*batch modules inputs cables"]) -> Float[Array, "*batch modules 6"]:
        """States for what the hysteresis weighs (`Hysteresis.inputs`); training goes in here."""
        body = jax.lax.stop_gradient(self.body)
        carried = self.hysteresis.transmitted(inputs)
        if self.statics:
            still = jnp.zeros((*carried.shape[:-1], 2))
            alone = self._at_rest(carried, still, body)
            said = self._network(jnp.concatenate([alone, carried], axis=-1))
            bends = self._at_rest(carried, MOMENT_UNIT * said[..., :2], body)
        else:
            own = body.bends(carried)
            mixed = own.reshape(*own.shape[:-2], -1) @ self.mixing
            bends = mixed.reshape(own.shape)
            said = self._network(bends)
        bends = bends + BEND_CORRECTION_UNIT * said[..., 2:4]
        ends = END_CORRECTION_UNIT * body.lengths[:, None] * said[..., 4:]
        return states_from_arcs(bends, body.lengths, ends)

    def _at_rest(self, carried: Array, moments: Array, body: Body) -> Array:
        stiffness = jnp.exp(self.log_stiffness)
        return bend_at_rest(carried, moments, body.matrices, stiffness, self.tautness, self.engaged)

    def _network(self, features: Float[Array, "*batch modules features"]) -> Float[Array, "*batch modules outputs"]:
        flat = features.reshape(-1, features.shape[-2] * features.shape[-1]) / BEND_UNIT
        return jax.vmap(self.network)(flat).reshape(*features.shape[:-1], OUTPUTS)


def _is_felt_through_cables(arm: ArmSpec) -> bool:
    """Whether sensed configurations are displacements of pulling cables, module by module."""
    return arm.actuation == "displacement" and arm.sensing == "encoders" and arm.sensing_coupling is None
