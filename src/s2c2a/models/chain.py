"""The forward model of the `best` recipe: cables with memory, modules at rest, arcs in a row, and what they leave out.

From the desired configuration to what the cables carry over (`Hysteresis`), from there
to the bends at which modules come to rest (`bend_at_rest`), from bends to states along
the chain of arcs. A small network adds what this leaves out: moments of gravity, bends
and end points that arcs do not have.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics import ForwardModel
from s2c2a.kinematics.chain import states_from_arcs
from s2c2a.models.cables import Hysteresis, HysteresisMemory
from s2c2a.models.statics import Equilibrium, Rest
from s2c2a.models.trunk import Trunk
from s2c2a.models.disturbances import Disturbances, moments_of_weights

BEND_UNIT = 0.5  # rad; inputs of the network are about one
# rad; an output of one
MOMENT_UNIT = 1.0
BEND_CORRECTION_UNIT = 0.2
END_CORRECTION_UNIT = 0.1  # of a module's length
OUTPUTS = 7  # of every module: moment 2, bend 2, end 3
LOADED = 3  # times that a load and the shape under it are brought together in a step


class ChainMemory(NamedTuple):
    """What the chain remembers.

    Attributes:
        cables: what the sensors' past left behind.
        disturbances: what came about since the recording.
        hung: moments of what hangs at the tip, where the arm was of late [rad], shape
            (modules, 2). They hardly change within a step, and are worked out once in
            each.
        each: the same of a kilogram more, there [rad/kg], shape (modules, 2).
    """

    cables: HysteresisMemory
    disturbances: Disturbances
    hung: Float[Array, "modules 2"]
    each: Float[Array, "modules 2"]


class ChainC2S(ForwardModel):
    """Hysteresis, statics, arcs and a network.

    Attributes:
        body: what follows from the arm.
        hysteresis: of the cables.
        equilibrium: how modules come to rest.
        mixing: where there are no statics, what bends all modules' sensed bends stand
            for, shape (2 modules, 2 modules).
        network: what the rest leaves out.
        statics: whether cables only pull.
        engaged: whether slopes are those of taut cables that follow their motors.
    """

    body: Trunk
    hysteresis: Hysteresis
    equilibrium: Equilibrium
    mixing: Float[Array, "bends bends"]
    network: eqx.nn.MLP
    statics: bool = eqx.field(static=True)
    engaged: bool = eqx.field(static=True, default=False)

    def for_planning(self) -> "ChainC2S":
        """The same predictions with the slopes of taut cables that follow their motors."""
        return replace(
            self, hysteresis=replace(self.hysteresis, engaged=True), engaged=True
        )

    def near(
        self, configurations: Float[Array, "modules 3"], memory: ChainMemory
    ) -> "ChainC2S":
        """See `ForwardModel`: where the arm is once it has arrived there, if a step is shorter than its delay."""
        return replace(
            self,
            hysteresis=replace(self.hysteresis, arrived=self.hysteresis.delays > 0),
        )

    def start(self, sensed: Float[Array, "*batch modules 3"]) -> ChainMemory:
        """See `ForwardModel`."""
        modules = len(self.body.lengths)
        cables = self.hysteresis.start(self.body.displacements(sensed))
        none = jnp.zeros((modules, 2))
        return ChainMemory(cables, Disturbances.none(modules), none, none)

    def observe(
        self, sensed: Float[Array, "*batch modules 3"], memory: ChainMemory
    ) -> ChainMemory:
        """See `ForwardModel`."""
        return memory._replace(
            cables=self.hysteresis.advance(
                self.body.displacements(sensed), memory.cables
            )
        )

    def given(
        self,
        disturbances: Disturbances,
        sensed: Float[Array, "*batch modules 3"],
        memory: ChainMemory,
    ) -> ChainMemory:
        """See `ForwardModel`."""
        inputs = self.inputs(self.body.displacements(sensed), memory)
        hung, each = self._hung(disturbances.load, inputs, memory.hung)
        return memory._replace(disturbances=disturbances, hung=hung, each=each)

    def corrected(self, disturbances: Disturbances, memory: ChainMemory) -> ChainMemory:
        """See `ForwardModel`."""
        more = (disturbances.load - memory.disturbances.load) * memory.each
        return memory._replace(disturbances=disturbances, hung=memory.hung + more)

    def predict(
        self, configurations: Float[Array, "*batch modules 3"], memory: ChainMemory
    ) -> Array:
        """States [m, 1], shape (*batch, modules, 6), base frame."""
        inputs = self.inputs(self.body.displacements(configurations), memory)
        return self.states(inputs, memory)

    def inputs(
        self, displacements: Float[Array, "*batch modules cables"], memory: ChainMemory
    ) -> Array:
        """What the hysteresis weighs (`Hysteresis.inputs`)."""
        return self.hysteresis.inputs(displacements, memory.cables)

    def states(
        self,
        inputs: Float[Array, "*batch modules inputs cables"],
        memory: ChainMemory | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        """States for what the hysteresis weighs; training goes in here.

        Args:
            inputs: see `inputs`.
            memory: of what came about since the recording, if anything.
        """
        rest, lengths, said = self._at_rest(
            inputs, None if memory is None else memory.hung
        )
        bends = rest.bends + BEND_CORRECTION_UNIT * said[..., 2:4]
        ends = END_CORRECTION_UNIT * self.body.lengths[:, None] * said[..., 4:]
        if memory is None:
            return states_from_arcs(bends, lengths, ends)
        force = memory.disturbances.load * self.body.gravity
        return states_from_arcs(
            bends + memory.disturbances.leans, lengths, ends, force, self.body.gives
        )

    def tensions(
        self, configurations: Float[Array, "*batch modules 3"], memory: ChainMemory
    ) -> Array:
        """See `ForwardModel`."""
        inputs = self.inputs(self.body.displacements(configurations), memory)
        pulls = self._at_rest(inputs, memory.hung)[0].pulls
        return (
            pulls / self.body.moments if self.statics else jnp.full_like(pulls, jnp.nan)
        )

    def cable_stiffnesses(self) -> Float[np.ndarray, " modules"] | None:
        """See `ForwardModel`."""
        if not self.statics:
            return None
        return (
            np.exp(np.asarray(self.equilibrium.log_stiffness))
            / np.asarray(self.body.moments)[:, 0]
        )

    def _at_rest(
        self, inputs: Array, hung: Array | None = None
    ) -> tuple[Rest, Array, Array]:
        """Modules at rest under moments of what hangs at the tip [rad], their lengths [m], what the network says."""
        inputs = (
            self.hysteresis.without_delay(inputs) if self.hysteresis.arrived else inputs
        )
        carried = self.hysteresis.transmitted(inputs)
        more = jnp.zeros(2) if hung is None else hung
        if self.statics:
            settled = partial(
                self.equilibrium.settled,
                carried,
                matrices=self.body.matrices,
                engaged=self.engaged,
            )
            held = self._relaxed(inputs)
            alone = settled(held, before=None)
            said = self._network(jnp.concatenate([alone.bends, carried], axis=-1))
            rest = settled(held + MOMENT_UNIT * said[..., :2] + more, before=alone)
            return rest, self.body.lengths - self.body.radii * rest.shorter, said
        own = self.body.bends(carried)
        mixed = (own.reshape(*own.shape[:-2], -1) @ self.mixing).reshape(own.shape)
        bends = mixed + (self.body.yields / self.body.compliances)[:, None] * more
        none = jnp.zeros_like(bends)
        rest = Rest(
            bends, none[..., 0], none[..., :1], none, none, jnp.zeros_like(carried)
        )
        return rest, self.body.lengths, self._network(mixed)

    def _hung(
        self, load: Float[Array, ""], inputs: Array, hung: Float[Array, "modules 2"]
    ) -> tuple[Array, Array]:
        """Moments of what hangs at the tip, and of modules that sink further under it, from those of the last step.

        Also those of a kilogram more.

        Step by step they come to rest as the arm itself does. Newton's steps get there
        sooner, but go round in circles where cables become taut or slack; and slopes
        that know of sinking lead planners astray there.
        """
        weigh = partial(
            moments_of_weights,
            compliances=self.body.compliances,
            gravity=self.body.gravity,
        )
        tip = jnp.zeros_like(self.body.weights).at[-1].set(1.0)
        alone, lengths, _ = self._at_rest(inputs)
        own = weigh(self.body.weights, alone.bends, lengths)

        def sunk(_, before: tuple[Array, Array]) -> tuple[Array, Array]:
            under, lengths, _ = self._at_rest(inputs, before[0])
            each = weigh(tip, under.bends, lengths)
            return weigh(
                self.body.weights, under.bends, lengths
            ) + load * each - own, each

        return jax.lax.fori_loop(0, LOADED, sunk, (hung, jnp.zeros_like(own)))

    def _relaxed(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch modules 2"]:
        """Moments of bends that cables asked for before [rad]."""
        crept = inputs[
            ..., inputs.shape[-2] - self.hysteresis.creep_weights.shape[1] :, :
        ]
        return jnp.einsum(
            "mt,mkn,...mtn->...mk", self.equilibrium.relaxing, self.body.inverses, crept
        )

    def _network(
        self, features: Float[Array, "*batch modules features"]
    ) -> Float[Array, "*batch modules outputs"]:
        flat = features.reshape(-1, features.shape[-2] * features.shape[-1]) / BEND_UNIT
        return jax.vmap(self.network)(flat).reshape(*features.shape[:-1], OUTPUTS)
