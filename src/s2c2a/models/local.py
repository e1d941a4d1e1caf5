"""The forward model of the recipe `best`: the chain, and a process of its residual.

The chain extrapolates. Near the data, a Gaussian process (`ResidualProcess`) predicts the
residual of the chain from the displacements and their hysteresis. Away from
the data it is zero, so that the chain predicts alone, and the deviation grows
(`DataRegion`).
"""

from dataclasses import replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics import bends_from_configurations, limit_lengths
from s2c2a.kinematics.chain import States
from s2c2a.models.arrays import Actions, Bends, Configurations, Deviations, ModuleBends
from s2c2a.models.cables import HysteresisMemory, Inputs
from s2c2a.models.chain import ChainC2S
from s2c2a.models.data_region import PRIOR_STD, DataRegion
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import WrappedModel
from s2c2a.models.residual_process import Features, PerFeature, ResidualProcess
from s2c2a.spaces import AXIS, POSITION

NEARBY = 0.2  # rad; radius within which the tangent holds
EVERY_OTHER = slice(1, None, 2)  # play operators whose outputs are features


class Tangent(NamedTuple):
    """First-order expansion of the process at a configuration.

    Attributes:
        bends: of the configuration [rad], shape (modules, 2).
        features: of the process there, shape (features,).
        values: means of the process there, shape (outputs,).
        slopes: their derivatives by features, shape (outputs, features).
    """

    bends: ModuleBends
    features: PerFeature
    values: Float[Array, " outputs"]
    slopes: Float[Array, "outputs features"]


class LocalC2S(WrappedModel):
    """The chain model and a Gaussian process of its residual.

    Attributes:
        chain: hysteresis, statics, arcs.
        process: of its residual, scaled.
        region: of the training data.
        unit: of position outputs [m]; that of axes is one.
        tangent: replaces the process near a configuration, if given.
    """

    chain: ChainC2S
    process: ResidualProcess
    region: DataRegion
    unit: float = eqx.field(static=True)
    tangent: Tangent | None = None

    @property
    def inner(self) -> ChainC2S:
        """See `WrappedModel`: the chain."""
        return self.chain

    def for_planning(self) -> "LocalC2S":
        return replace(self, chain=self.chain.for_planning())

    def near(
        self, configurations: Float[Array, "modules 3"], memory: HysteresisMemory
    ) -> "LocalC2S":
        """See `ForwardModel`: the process is evaluated once a control step."""
        bends = bends_from_configurations(configurations)
        near = replace(self, chain=self.chain.near(configurations, memory))
        features = near.features(near._inputs_at(bends, memory))
        nothing = jnp.zeros_like(self.process.constant)
        # zero if the process has no samples
        values, slopes = jax.lax.cond(
            self.process.is_fitted,
            lambda: (self.process(features), jax.jacrev(self.process)(features)),
            lambda: (nothing, jnp.zeros((*nothing.shape, *features.shape))),
        )
        return replace(near, tangent=Tangent(bends, features, values, slopes))

    def predict(
        self,
        configurations: Configurations,
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> States:
        bends = bends_from_configurations(configurations)
        inputs = self._inputs_at(bends, memory)
        states = self.chain.states(inputs, disturbances)
        tangent = self.tangent
        if tangent is None:
            return self._corrected(states, self.process(self.features(inputs)))
        # beyond the radius of the expansion, values are those at its border
        away = limit_lengths(bends - tangent.bends, NEARBY)
        near = self._inputs_at(tangent.bends + away, memory)
        moved = self.features(near) - tangent.features
        values = tangent.values + jnp.einsum("of,...f->...o", tangent.slopes, moved)
        return self._corrected(states, values)

    def _inputs_at(self, bends: Bends, memory: HysteresisMemory) -> Inputs:
        moved = jnp.einsum("mnk,...mk->...mn", self.chain.body.matrices, bends)
        return self.chain.inputs(moved, memory)

    def predictive_std(
        self, configurations: Configurations, memory: HysteresisMemory
    ) -> Deviations:
        displacements = self.chain.body.displacements(configurations)
        return self.std_at(self.chain.inputs(displacements, memory))

    def std_at(self, inputs: Inputs) -> Deviations:
        """`predictive_std` for inputs of the hysteresis model.

        That of the process, of its samples, and of the chain's reach.
        """
        variance = self.process.variance(self.features(inputs)) + self.process.noise
        # deviation of each end from its prediction, per that of the process [m]
        scales = self.process.scale.reshape(-1, 6)[:, POSITION]
        of_ends = self.unit * jnp.sqrt(jnp.sum(scales**2, axis=-1))
        near = jnp.sqrt(variance)[..., None] * of_ends
        modules = jnp.arange(1, len(self.chain.body.lengths) + 1)
        sensed = inputs[..., 0, :] - self.chain.body.slack
        beyond = self._extrapolation_at(sensed)[..., None]
        return jnp.hypot(near, beyond * modules / len(modules))

    def extrapolation(self, configurations: Configurations) -> Float[Array, "*batch"]:
        return self._extrapolation_at(self.chain.body.displacements(configurations))

    def _extrapolation_at(self, displacements: Actions) -> Float[Array, "*batch"]:
        relative = self.region.extrapolation(self.region_features(displacements))
        return PRIOR_STD * jnp.sum(self.chain.body.lengths) * relative

    def states(self, inputs: Inputs) -> States:
        """States for inputs of the hysteresis model. Training calls this."""
        residual = self.process(self.features(inputs))
        return self._corrected(self.chain.states(inputs), residual)

    def region_features(self, displacements: Actions) -> Features:
        """Features of `DataRegion`: bends and common displacements [rad], without hysteresis."""
        bends = self.chain.body.bends(displacements)
        common = jnp.mean(displacements, axis=-1, keepdims=True)
        return jnp.concatenate([bends, common], axis=-1).reshape(*bends.shape[:-2], -1)

    def features(self, inputs: Inputs) -> Features:
        """Features of the process: bends and common displacements.

        They are those of the present displacements and of some play operators. Those of
        the filters would show speed and vibration, which a plan does not have.
        """
        plays = len(self.chain.hysteresis.operators.widths)
        used = jnp.concatenate(
            [inputs[..., :1, :], inputs[..., 1 : plays + 1, :][..., EVERY_OTHER, :]],
            axis=-2,
        )
        bends = jnp.einsum("mkn,...mjn->...mjk", self.chain.body.inverses, used)
        common = jnp.mean(used, axis=-1, keepdims=True)
        return jnp.concatenate([bends, common], axis=-1).reshape(*used.shape[:-3], -1)

    def _corrected(
        self, states: States, outputs: Float[Array, "*batch outputs"]
    ) -> States:
        """States of the chain with their expected residual."""
        units = jnp.repeat(jnp.array([self.unit, 1.0]), 3)  # [m, 1]
        corrected = states + units * outputs.reshape(*outputs.shape[:-1], -1, 6)
        axes = corrected[..., AXIS]
        unit_axes = axes / jnp.linalg.norm(axes, axis=-1, keepdims=True)
        return jnp.concatenate([corrected[..., POSITION], unit_axes], axis=-1)
