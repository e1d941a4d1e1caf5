"""The forward model of the recipe `best`: the chain, and kernels for its residual.

The chain extrapolates. Near the data, a local model (`Kernels`) predicts the residual of
the chain from the displacements, their hysteresis, and their lag. Away from the data it
fades out, so that the chain predicts alone. `Uncertainty` estimates the errors of both.
"""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from s2c2a.kinematics import bends_from_configurations, limit_lengths
from s2c2a.kinematics.bends import squared_norm
from s2c2a.models.cables import HysteresisMemory
from s2c2a.models.chain import ChainC2S
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.kernels import Kernels
from s2c2a.models.uncertainty import Uncertainty
from s2c2a.spaces import AXIS, POSITION

NEARBY = 0.2  # rad; radius within which the tangent holds
EVERY_OTHER = slice(1, None, 2)  # play operators whose outputs are features


class Tangent(NamedTuple):
    """First-order expansion of the local model at a configuration.

    Attributes:
        bends: of the configuration [rad], shape (modules, 2).
        features: of the local model there, shape (features,).
        outputs: of the kernels there, shape (outputs,).
        slopes: derivatives of outputs by features, shape (outputs, features).
        support: of the kernels there, from 0 to 1, shape ().
    """

    bends: Float[Array, "modules 2"]
    features: Float[Array, " features"]
    outputs: Float[Array, " outputs"]
    slopes: Float[Array, "outputs features"]
    support: Float[Array, ""]


class LocalC2S(ForwardModel):
    """The chain model and kernels for its residual.

    Attributes:
        chain: hysteresis, statics, arcs.
        kernels: of its residual, scaled.
        share: weight of the chain in every output of the local model, from 0 to 1,
            shape (modules, 6).
        uncertainty: distribution of the data, and errors there.
        unit: of position outputs [m]; that of axes is one.
        tangent: replaces the kernels near a configuration, if given.
    """

    chain: ChainC2S
    kernels: Kernels
    share: Float[Array, "modules 6"]
    uncertainty: Uncertainty
    unit: float = eqx.field(static=True)
    tangent: Tangent | None = None

    def start(self, sensed: Float[Array, "*batch modules 3"]) -> HysteresisMemory:
        return self.chain.start(sensed)

    def observe(
        self, sensed: Float[Array, "*batch modules 3"], memory: HysteresisMemory
    ) -> HysteresisMemory:
        return self.chain.observe(sensed, memory)

    @property
    def takes_payload(self) -> bool:
        return True

    def with_moments(
        self,
        disturbances: Disturbances,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
        before: Disturbances,
    ) -> Disturbances:
        return self.chain.with_moments(disturbances, configurations, memory, before)

    def tensions(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules cables"]:
        return self.chain.tensions(configurations, memory, disturbances)

    def cable_stiffnesses(self) -> Float[np.ndarray, " modules"] | None:
        return self.chain.cable_stiffnesses()

    def for_planning(self) -> "LocalC2S":
        return replace(self, chain=self.chain.for_planning())

    def near(
        self, configurations: Float[Array, "modules 3"], memory: HysteresisMemory
    ) -> "LocalC2S":
        """See `ForwardModel`: the kernels are evaluated once a control step."""
        bends = bends_from_configurations(configurations)
        near = replace(self, chain=self.chain.near(configurations, memory))
        return replace(near, tangent=near._tangent_at(bends, memory))

    def _tangent_at(
        self, bends: Float[Array, "modules 2"], memory: HysteresisMemory
    ) -> Tangent:
        """The expansion of the kernels; zero if they are not fitted."""
        features = self._features_at(bends, memory)
        no_output = jnp.zeros(self.kernels.constant.shape)
        no_slopes = jnp.zeros((*no_output.shape, *features.shape))

        def expanded() -> tuple[Array, Array]:
            return jax.jacrev(lambda at: (self.kernels(at),) * 2, has_aux=True)(
                features
            )

        # unfitted kernels are not evaluated
        has_kernels = self.kernels.is_fitted > 0.0
        slopes, outputs = jax.lax.cond(
            has_kernels, expanded, lambda: (no_slopes, no_output)
        )
        support = self.kernels.support(features)
        return Tangent(bends, features, outputs, slopes, support)

    def predict(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        displacements = self.chain.body.displacements(configurations)
        inputs = self.chain.inputs(displacements, memory)
        states = self.chain.states(inputs, disturbances)
        if self.tangent is None:
            return self._locally_corrected(states, self.features(inputs))
        outputs = self._along(self.tangent, configurations, memory)
        return self._corrected(states, outputs, self.tangent.support)

    def _along(
        self,
        tangent: Tangent,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
    ) -> Array:
        """Outputs of the expansion; beyond its radius, those at its border."""
        away = limit_lengths(
            bends_from_configurations(configurations) - tangent.bends, NEARBY
        )
        moved = self._features_at(tangent.bends + away, memory) - tangent.features
        return tangent.outputs + jnp.einsum("of,...f->...o", tangent.slopes, moved)

    def _features_at(
        self, bends: Float[Array, "*batch modules 2"], memory: HysteresisMemory
    ) -> Float[Array, "*batch features"]:
        """Features at bends [rad] that are planned after this memory."""
        moved = jnp.einsum("mnk,...mk->...mn", self.chain.body.matrices, bends)
        return self.features(self.chain.inputs(moved, memory))

    def predictive_std(
        self, configurations: Float[Array, "*batch modules 3"], memory: HysteresisMemory
    ) -> Float[Array, "*batch modules"]:
        """See `ForwardModel`; the speed is that of the last two readings."""
        displacements = self.chain.body.displacements(configurations)
        features = self.extrapolation_features(displacements)
        extrapolation = self.uncertainty.extrapolation(features)
        moved = self.chain.body.bends(memory.last - memory.previous)
        speed = jnp.sqrt(jnp.mean(squared_norm(moved), axis=-1))
        return self.uncertainty.std(extrapolation, speed)

    def extrapolation(
        self, configurations: Float[Array, "*batch modules 3"]
    ) -> Float[Array, "*batch"]:
        displacements = self.chain.body.displacements(configurations)
        features = self.extrapolation_features(displacements)
        return self.uncertainty.tip_extrapolation(features)

    def states(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch modules 6"]:
        """States for inputs of the hysteresis model. Training calls this."""
        return self._locally_corrected(self.chain.states(inputs), self.features(inputs))

    def extrapolation_features(
        self, displacements: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch features"]:
        """Features of `Uncertainty`: bends and common displacements [rad].

        They do not depend on the hysteresis.
        """
        bends = self.chain.body.bends(displacements)
        common = jnp.mean(displacements, axis=-1, keepdims=True)
        return jnp.concatenate([bends, common], axis=-1).reshape(*bends.shape[:-2], -1)

    def features(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch features"]:
        """Features of the local model: bends and common displacements.

        They are those of the present displacements, of some play operators, and of the
        lag of the filters at the last reading. The lag follows from readings alone: a
        plan is ahead of the arm, and would look like speed.
        """
        hysteresis = self.chain.hysteresis
        operators = hysteresis.operators
        plays = len(operators.widths)
        shares = operators.shares[:, None]
        now = inputs[..., :1, :]
        after_play = inputs[..., 1 : plays + 1, :]
        last = inputs[..., plays + 1 : plays + 2, :]
        filtered = (inputs[..., plays + 2 :, :] - shares * now) / (1.0 - shares)
        lag = last - filtered
        if hysteresis.arrived:
            lag = lag.at[..., : hysteresis.delays, :].set(0.0)
        used = jnp.concatenate([now, after_play[..., EVERY_OTHER, :], lag], axis=-2)
        bends = jnp.einsum("mkn,...mjn->...mjk", self.chain.body.inverses, used)
        common = jnp.mean(used, axis=-1, keepdims=True)
        return jnp.concatenate([bends, common], axis=-1).reshape(*used.shape[:-3], -1)

    def mixed(
        self, share: float, weight: float, known: Bool[np.ndarray, "modules 6"]
    ) -> "LocalC2S":
        """A mixture of the chain alone and of kernels, whose weight is one before.

        Args:
            share: of the chain whose residual the kernels were fitted to.
            weight: of the kernels.
            known: which outputs the data hold; the chain alone predicts the others.
        """
        replaced = weight * (1.0 - share) * self.kernels.is_fitted * known
        return replace(self, kernels=self.kernels.times(weight), share=1.0 - replaced)

    def _locally_corrected(
        self,
        states: Float[Array, "*batch modules 6"],
        features: Float[Array, "*batch features"],
    ) -> Float[Array, "*batch modules 6"]:
        """States of the chain, corrected where the local model has data."""
        outputs = self.kernels(features)
        return self._corrected(states, outputs, self.kernels.support(features))

    def _corrected(
        self,
        states: Float[Array, "*batch modules 6"],
        outputs: Float[Array, "*batch outputs"],
        support: Float[Array, "*batch"],
    ) -> Float[Array, "*batch modules 6"]:
        """States between those of the chain and of the local model, by its support."""
        residual = outputs.reshape(*outputs.shape[:-1], -1, 6)
        units = jnp.repeat(jnp.array([self.unit, 1.0]), 3)  # [m, 1]
        change = (self.share - 1.0) * states + units * residual
        blended = states + support[..., None, None] * change
        axes = blended[..., AXIS]
        unit_axes = axes / jnp.linalg.norm(axes, axis=-1, keepdims=True)
        return jnp.concatenate([blended[..., POSITION], unit_axes], axis=-1)
