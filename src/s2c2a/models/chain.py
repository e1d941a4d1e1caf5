"""The chain model: cables with hysteresis, modules in static equilibrium, arcs in a row.

The forward model of the recipe `best`. From the planned configuration it computes what
the cables transmit (`Hysteresis`), then the bends at which the modules are in
equilibrium under their weights (`bend_at_rest`), then the states along the chain of arcs.
A small network adds what this structure leaves out: moments, bends and end points that
arcs do not have.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.kinematics.chain import States, states_from_arcs
from s2c2a.models.arrays import Actions, Bends, Configuration, Configurations
from s2c2a.models.cables import Hysteresis, HysteresisMemory, Inputs
from s2c2a.models.disturbances import (
    PAYLOAD_ITERATIONS,
    Disturbances,
    LoadGains,
    moments_of_weights,
)
from s2c2a.models.forward_model import ForwardModel, Stiffnesses
from s2c2a.models.statics import SWEEPS, Equilibrium, StaticState
from s2c2a.models.trunk import Trunk

BEND_UNIT = 0.5  # rad; scales the inputs of the network to about one
BEND_CORRECTION_UNIT = 0.2  # rad; scale of the network's bends
END_CORRECTION_UNIT = 0.1  # of a module's length; scale of the network's end points
OUTPUTS = 7  # of the network, per module: moment [rad] 2, bend 2, end point 3


class ChainC2S(ForwardModel):
    """Hysteresis, static equilibrium, arcs and a network.

    Attributes:
        body: constants that follow from the arm.
        hysteresis: of the cables.
        equilibrium: of the modules.
        mixing: without statics, the linear map from all sensed bends to all bends, shape
            (2 modules, 2 modules).
        network: the residual of the structure.
        statics: whether cables only pull.
    """

    body: Trunk
    hysteresis: Hysteresis
    equilibrium: Equilibrium
    mixing: Float[Array, "bends bends"]
    network: eqx.nn.MLP
    statics: bool = eqx.field(static=True)

    @property
    def takes_payload(self) -> bool:
        return True

    def for_planning(self) -> "ChainC2S":
        """See `ForwardModel`: with gradients of taut cables that follow their motors."""
        return replace(self, hysteresis=replace(self.hysteresis, engaged=True))

    def near(
        self, configurations: Configuration, memory: HysteresisMemory
    ) -> "ChainC2S":
        """See `ForwardModel`: at short control periods, the arm after its delay."""
        arrived = self.hysteresis.delays > 0
        return replace(self, hysteresis=replace(self.hysteresis, arrived=arrived))

    def start(self, sensed: Configurations) -> HysteresisMemory:
        return self.hysteresis.start(self._slack(self.body.displacements(sensed)))

    def observe(
        self, sensed: Configurations, memory: HysteresisMemory
    ) -> HysteresisMemory:
        moved = self._slack(self.body.displacements(sensed))
        return self.hysteresis.advance(moved, memory)

    def with_moments(
        self,
        disturbances: Disturbances,
        configurations: Configurations,
        memory: HysteresisMemory,
        before: Disturbances,
    ) -> Disturbances:
        """See `ForwardModel`.

        Payload moments and shape are iterated over control steps, as the arm itself
        comes to rest. Newton's method converges sooner, but cycles where cables become
        taut or slack.
        """
        inputs = self.inputs(self.body.displacements(configurations), memory)

        def iterate(_: int, last: tuple[Array, Array]) -> tuple[Array, Array]:
            loaded, lengths, _corrections = self._at_rest(inputs, last[0])
            per_kg = self._moments_of(self._tip_mass, loaded.bends, lengths)
            return disturbances.payload * per_kg, per_kg

        first = (before.moments, before.moments)  # the second is replaced
        moments, per_kg = jax.lax.fori_loop(0, PAYLOAD_ITERATIONS, iterate, first)
        return disturbances._replace(moments=moments, moments_per_kg=per_kg)

    def with_gains(
        self,
        disturbances: Disturbances,
        configurations: Configuration,
        memory: HysteresisMemory,
    ) -> Disturbances:
        """See `ForwardModel`: the iteration of `with_moments`, linearized.

        A few iterations, instead of its limit, are bounded for an arm that buckles too.
        """
        if disturbances.moments is None:
            return disturbances
        inputs = self.inputs(self.body.displacements(configurations), memory)
        loaded, lengths, _corrections = self._at_rest(inputs, disturbances.moments)
        identity = jnp.eye(loaded.bends.size)

        def slopes(function, at: Array) -> Float[Array, "bends bends"]:
            return jax.jacfwd(function)(at).reshape(identity.shape)

        compliance = slopes(
            lambda moments: self._at_rest(inputs, moments)[0].bends,
            disturbances.moments,
        )
        per_kg = slopes(
            lambda bends: self._moments_of(self._tip_mass, bends, lengths), loaded.bends
        )
        matrix = identity
        for _ in range(PAYLOAD_ITERATIONS):
            matrix = identity + disturbances.payload * compliance @ per_kg @ matrix
        return disturbances._replace(gains=LoadGains(loaded.bends, matrix))

    @property
    def _tip_mass(self) -> Float[Array, " modules"]:
        """One kilogram at the tip."""
        return jnp.zeros_like(self.body.weights).at[-1].set(1.0)

    def _moments_of(self, weights: Array, bends: Array, lengths: Array) -> Bends:
        return moments_of_weights(
            weights, bends, lengths, self.body.compliances, self.body.gravity
        )

    def predict(
        self,
        configurations: Configurations,
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> States:
        inputs = self.inputs(self.body.displacements(configurations), memory)
        return self.states(inputs, disturbances)

    def inputs(self, displacements: Actions, memory: HysteresisMemory) -> Inputs:
        """The inputs of the hysteresis model (`Hysteresis.inputs`)."""
        return self.hysteresis.inputs(self._slack(displacements), memory)

    def _slack(self, displacements: Actions) -> Actions:
        """Displacements of cables that are longer than at the training."""
        return displacements + self.body.slack

    def states(
        self, inputs: Inputs, disturbances: Disturbances | None = None
    ) -> States:
        """States [m, 1] for inputs of the hysteresis model, base frame.

        Args:
            inputs: see `inputs`.
            disturbances: with moments; None as in the training data.
        """
        moments = None if disturbances is None else disturbances.moments
        rest, lengths, corrections = self._at_rest(inputs, moments)
        own = rest.bends
        if disturbances is not None and disturbances.gains is not None:
            own = disturbances.gains.applied(own)
        bends = own + BEND_CORRECTION_UNIT * corrections[..., 2:4]
        ends = END_CORRECTION_UNIT * self.body.lengths[:, None] * corrections[..., 4:]
        if disturbances is None:
            return states_from_arcs(bends, lengths, ends)
        bends = bends + disturbances.bend_biases
        force = disturbances.payload * self.body.gravity
        return states_from_arcs(
            bends, lengths, ends, force, self.body.lateral_compliances
        )

    def tensions(
        self,
        configurations: Configurations,
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> Actions:
        inputs = self.inputs(self.body.displacements(configurations), memory)
        moments = None if disturbances is None else disturbances.moments
        pulls = self._at_rest(inputs, moments)[0].pulls
        if not self.statics:
            return jnp.full_like(pulls, jnp.nan)
        return pulls / (self.body.moments * self.body.softness[:, None])

    def cable_stiffnesses(self) -> Stiffnesses | None:
        if not self.statics:
            return None
        stiffness = np.exp(np.asarray(self.equilibrium.log_stiffness))
        return stiffness / np.asarray(self.body.moments)[:, 0]

    def _at_rest(
        self, inputs: Inputs, moments: Float[Array, "modules 2"] | None = None
    ) -> tuple[StaticState, Array, Array]:
        """Modules in equilibrium under payload moments [rad].

        Returns:
            The equilibrium, the modules' lengths [m] and the network's outputs.
        """
        if self.hysteresis.arrived:
            inputs = self.hysteresis.without_delay(inputs)
        if moments is None:
            moments = jnp.zeros(2)
        transmitted = self.hysteresis.transmitted(inputs)
        if not self.statics:  # a linear map of the bends
            own = self.body.bends(transmitted)
            mixed = (own.reshape(*own.shape[:-2], -1) @ self.mixing).reshape(own.shape)
            shares = (self.body.taut_compliances / self.body.compliances)[:, None]

            def by_weights(bends: Bends) -> Bends:
                return self._moments_of(self.body.weights, bends, self.body.lengths)

            # the map knows the weights of an arm without payload, not how they sag under it
            sagging = by_weights(mixed + shares * moments) - by_weights(mixed)
            bends = self.body.softness[:, None] * (mixed + shares * (moments + sagging))
            zeros = jnp.zeros_like(bends)
            pulls = jnp.zeros_like(transmitted)
            rest = StaticState(
                bends, zeros[..., 0], zeros[..., :1], zeros, zeros, pulls
            )
            return rest, self.body.lengths, self._network(mixed)
        # moments of the viscoelastic body, which remembers former bends [rad]
        weights = self.equilibrium.relaxation.weights[..., 0]
        former = inputs[..., inputs.shape[-2] - weights.shape[-1] :, :]
        relaxation = jnp.einsum(
            "mt,mkn,...mtn->...mk", weights, self.body.inverses, former
        )
        softness = self.body.softness[:, None]

        def sweep(state: tuple[StaticState, Array], number: Array):
            rest, corrections = state
            is_loaded = number >= SWEEPS
            lengths = self.body.lengths - self.body.radii * rest.shortening
            own = self._moments_of(self.body.weights, rest.bends, lengths)
            load = own + corrections[..., :2] + jnp.where(is_loaded, moments, 0.0)
            rest = self.equilibrium.sweep(
                transmitted,
                softness * (relaxation + load),
                self.body.matrices,
                softness,
                rest,
                self.hysteresis.engaged,
                is_first=number == 0,
            )
            # the network sees the arm without payload
            corrections = jax.lax.cond(
                number == SWEEPS - 1,
                lambda: self._network(
                    jnp.concatenate([rest.bends, transmitted], axis=-1)
                ),
                lambda: corrections,
            )
            return (rest, corrections), None

        none = jnp.zeros((*transmitted.shape[:-1], OUTPUTS))
        start = StaticState.straight(transmitted), none
        (rest, corrections), _ = jax.lax.scan(sweep, start, jnp.arange(2 * SWEEPS))
        lengths = self.body.lengths - self.body.radii * rest.shortening
        return rest, lengths, corrections

    def _network(
        self, features: Float[Array, "*batch modules features"]
    ) -> Float[Array, "*batch modules outputs"]:
        width = features.shape[-2] * features.shape[-1]
        flat = features.reshape(-1, width) / BEND_UNIT  # (batch, modules * features)
        outputs = jax.vmap(self.network)(flat)
        return outputs.reshape(*features.shape[:-1], OUTPUTS)
