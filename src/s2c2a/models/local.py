"""The forward model of the recipe `best`: the chain, and kernels for its residual.

The chain extrapolates. Near the data, a local model (`Kernels`) predicts the residual of
the chain from the displacements, their hysteresis, and their lag. `Uncertainty`
estimates the errors of both.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions
from s2c2a.data.windows import Samples, Split
from s2c2a.kinematics import bends_from_configurations, limit_lengths
from s2c2a.models.cables import HysteresisMemory
from s2c2a.models.chain import ChainC2S
from s2c2a.models.chain_training import (
    ChainOptions,
    hysteresis_samples,
    predict_states,
    predicted_targets,
)
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.kernels import Kernels, fit_kernels
from s2c2a.models.transfer import babbling_data, interpolation_weights
from s2c2a.models.uncertainty import Uncertainty, fit_uncertainty
from s2c2a.training.fit import FitOptions, FitResult, Progress, check_limits, quiet
from s2c2a.training.trained import Trained, TrainingData, evaluated

# scales of the outputs, in parts of the arm's length and of axes
UNIT = 0.4
AXIS_UNIT = 1.0
FULL_BEND = 0.82  # rad; bend at which `play_widths` apply
MIN_REACH = 1e-3  # rad; for recordings with little motion
NEARBY = 0.2  # rad; radius within which the tangent holds
EVERY_OTHER = slice(1, None, 2)  # of the play operators are features
SHARES = 0.0, 0.5, 1.0  # of the chain whose residual is fitted
WEIGHTS = 0.5, 0.75, 1.0  # of the fitted residual


class Tangent(NamedTuple):
    """First-order expansion of the local model at a configuration.

    Attributes:
        bends: of the configuration [rad], shape (modules, 2).
        features: there, shape (features,).
        outputs: there, shape (outputs,).
        slopes: outputs by features, shape (outputs, features).
    """

    bends: Float[Array, "modules 2"]
    features: Float[Array, " features"]
    outputs: Float[Array, " outputs"]
    slopes: Float[Array, "outputs features"]


class LocalC2S(ForwardModel):
    """The chain model and kernels for its residual.

    Attributes:
        chain: hysteresis, statics, arcs.
        kernels: of its residual, scaled.
        share: weight of the chain in every output, shape (modules, 6).
        uncertainty: distribution of the data, and errors there.
        unit: of positions [m].
        tangent: replaces the kernels near a configuration, if given.
    """

    chain: ChainC2S
    kernels: Kernels
    share: Float[Array, "modules 6"]
    uncertainty: Uncertainty
    unit: float = eqx.field(static=True)
    tangent: Tangent | None = None

    def start(self, sensed: Float[Array, "*batch modules 3"]) -> HysteresisMemory:
        """See `ForwardModel`."""
        return self.chain.start(sensed)

    def observe(
        self, sensed: Float[Array, "*batch modules 3"], memory: HysteresisMemory
    ) -> HysteresisMemory:
        """See `ForwardModel`."""
        return self.chain.observe(sensed, memory)

    @property
    def takes_payload(self) -> bool:
        """See `ForwardModel`."""
        return True

    def with_moments(
        self,
        disturbances: Disturbances,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
        before: Disturbances,
    ) -> Disturbances:
        """See `ForwardModel`."""
        return self.chain.with_moments(disturbances, configurations, memory, before)

    def tensions(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules cables"]:
        """See `ForwardModel`."""
        return self.chain.tensions(configurations, memory, disturbances)

    def cable_stiffnesses(self) -> Float[np.ndarray, " modules"] | None:
        """See `ForwardModel`."""
        return self.chain.cable_stiffnesses()

    def for_planning(self) -> "LocalC2S":
        """See `ForwardModel`."""
        return replace(self, chain=self.chain.for_planning())

    def near(
        self, configurations: Float[Array, "modules 3"], memory: HysteresisMemory
    ) -> "LocalC2S":
        """See `ForwardModel`: the kernels are evaluated once a control step."""
        bends = bends_from_configurations(configurations)
        chain = self.chain.near(configurations, memory)
        features = replace(self, chain=chain)._features_at(bends, memory)
        no_output = jnp.zeros(self.kernels.constant.shape)
        nothing = jnp.zeros((*no_output.shape, *features.shape)), no_output

        def expanded() -> tuple[Array, Array]:
            return jax.jacrev(lambda at: (self.kernels(at),) * 2, has_aux=True)(
                features
            )

        # without kernels, the chain predicts alone
        has_kernels = self.kernels.is_fitted > 0.0
        slopes, value = jax.lax.cond(has_kernels, expanded, lambda: nothing)
        return replace(
            self, chain=chain, tangent=Tangent(bends, features, value, slopes)
        )

    def predict(
        self,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
        disturbances: Disturbances | None = None,
    ) -> Float[Array, "*batch modules 6"]:
        """See `ForwardModel`."""
        displacements = self.chain.body.displacements(configurations)
        inputs = self.chain.inputs(displacements, memory)
        states = self.chain.states(inputs, disturbances)
        if self.tangent is None:
            return self._corrected(states, self.kernels(self.features(inputs)))
        along_tangent = self._along(self.tangent, configurations, memory)
        return self._corrected(states, along_tangent)

    def _along(
        self,
        tangent: Tangent,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
    ) -> Array:
        """The expansion of the local model, within its radius."""
        away = limit_lengths(
            bends_from_configurations(configurations) - tangent.bends, NEARBY
        )
        moved = self._features_at(tangent.bends + away, memory) - tangent.features
        return tangent.outputs + jnp.einsum("of,...f->...o", tangent.slopes, moved)

    def _features_at(
        self, bends: Float[Array, "*batch modules 2"], memory: HysteresisMemory
    ) -> Array:
        moved = jnp.einsum("mnk,...mk->...mn", self.chain.body.matrices, bends)
        return self.features(self.chain.inputs(moved, memory))

    def predictive_std(
        self, configurations: Float[Array, "*batch modules 3"], memory: HysteresisMemory
    ) -> Array:
        """See `ForwardModel`."""
        return jnp.hypot(
            self.uncertainty.interpolation_error,
            self.extrapolation(configurations)[..., None],
        )

    def extrapolation(self, configurations: Float[Array, "*batch modules 3"]) -> Array:
        """See `ForwardModel`."""
        return self.uncertainty.meters(
            self.place(self.chain.body.displacements(configurations))
        )

    def states(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch modules 6"]:
        """States for inputs of the hysteresis model. Training calls this."""
        return self._corrected(
            self.chain.states(inputs), self.kernels(self.features(inputs))
        )

    def place(
        self, displacements: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch features"]:
        """Features of the predictive standard deviation: bends and common displacements."""
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
        operators = self.chain.hysteresis.operators
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
        """A mixture of the chain alone and of the fitted residual.

        Args:
            share: of the chain whose residual the kernels were fitted to.
            weight: of the kernels.
            known: which outputs the data hold; the chain alone predicts the others.
        """
        left_out = weight * (1.0 - share) * self.kernels.is_fitted * known
        return replace(self, kernels=self.kernels.times(weight), share=1.0 - left_out)

    def _corrected(
        self,
        states: Float[Array, "*batch modules 6"],
        outputs: Float[Array, "*batch outputs"],
    ) -> Float[Array, "*batch modules 6"]:
        """States of the chain with the residual of the local model."""
        residual = outputs.reshape(*outputs.shape[:-1], -1, 6)
        states = self.share * states
        positions = states[..., :3] + self.unit * residual[..., :3]
        axes = states[..., 3:] + AXIS_UNIT * residual[..., 3:]
        return jnp.concatenate(
            [positions, axes / jnp.linalg.norm(axes, axis=-1, keepdims=True)], axis=-1
        )


@dataclass(frozen=True)
class LocalOptions(ChainOptions):
    """Options of the chain and of the local model.

    Attributes:
        points: kernel centers.
        few: centers of the predictive standard deviation.
    """

    play_widths: tuple[float, ...] = (
        0.002,
        0.005,
        0.011,
        0.02,
        0.03,
        0.04,
        0.052,
        0.067,
        0.09,
        0.13,
    )
    points: int = 1536
    few: int = 64
    model: str = field(default="local", kw_only=True)

    def __post_init__(self):
        """Refuse impossible numbers."""
        super().__post_init__()
        check_limits(self, points=(8, 10_000), few=(4, 1000))

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> LocalC2S:  # type: ignore[override]
        """See `ForwardOptions`: the chain before training, without kernels."""
        chain = super().untrained(arm, key)
        modules = arm.module_count
        kernels = Kernels.unfitted(len(self._kinds(chain)), 6 * modules, self.points)
        none = jnp.ones((modules, 6)), Uncertainty.none(3 * modules, self.few, modules)
        return LocalC2S(chain, kernels, *none, UNIT * arm.length)

    def train(  # type: ignore[override]
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then its residual."""
        widths = tuple(width * _reach(data) / FULL_BEND for width in self.play_widths)
        chain = ChainOptions(
            self.hidden, self.depth, widths, self.creep_times, self.statics
        )
        return self._with_local(chain.train(data, fit, key, progress), data, key)

    def resume_training(  # type: ignore[override]
        self,
        model: LocalC2S,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then its residual."""
        trained = self._with_local(
            super().resume_training(model.chain, data, fit, key, progress), data, key
        )
        error = trained.network.uncertainty.interpolation_error
        uncertainty = replace(model.uncertainty, interpolation_error=error)
        network = replace(trained.network, uncertainty=uncertainty)
        return replace(trained, network=network)

    def adapted(  # type: ignore[override]
        self,
        model: LocalC2S,
        old: ArmSpec,
        new: ArmSpec,
        babbling: CollectOptions,
        key: PRNGKeyArray,
    ) -> LocalC2S:
        """See `ForwardOptions`: the chain; kernels belong to one arm alone."""
        chain = super().adapted(model.chain, old, new, babbling, key)
        blank = self.untrained(new, key)
        adapted = replace(blank, chain=chain, uncertainty=model.uncertainty)
        if old.module_count == new.module_count:
            return adapted
        samples = hysteresis_samples(chain, babbling_data(new, babbling))
        uncertainty = self._uncertainty(adapted, samples, new)
        weights = interpolation_weights(old.module_count, new.module_count)
        scale = new.length / old.length
        error = jnp.asarray(weights) @ model.uncertainty.interpolation_error * scale
        uncertainty = replace(uncertainty, interpolation_error=error)
        return replace(adapted, uncertainty=uncertainty)

    def _with_local(
        self, result: Trained[ChainC2S], data: TrainingData, key: PRNGKeyArray
    ) -> Trained[LocalC2S]:
        """A trained chain with the kernels that predict held-out samples best."""
        blank = replace(self.untrained(data.arm, key), chain=result.network)
        split = hysteresis_samples(result.network, data)
        known = np.isfinite(split.training.targets).any(axis=0)
        candidates = {(1.0, 0.0): blank}  # first, so that it wins ties
        for share in SHARES:
            fitted = self._with_kernels(blank, split.training, share)
            for weight in WEIGHTS:
                candidates[share, weight] = fitted.mixed(share, weight, known)
        (share, weight), best = min(
            candidates.items(), key=lambda one: _loss(one[1], split.validation)
        )
        model = replace(best, uncertainty=self._uncertainty(best, split, data.arm))
        trained = evaluated(FitResult(model, result.curve), predicted_targets, split)
        if best is blank:
            return trained
        # fit again, with the held-out samples
        fitted = self._with_kernels(model, _all_samples(split), share)
        return replace(trained, network=fitted.mixed(share, weight, known))

    def _with_kernels(
        self, blank: LocalC2S, samples: Samples, share: float
    ) -> LocalC2S:
        """The model with kernels fitted to what a share of the chain leaves."""
        inputs = jnp.asarray(samples.inputs["configurations"])
        features = np.asarray(eqx.filter_jit(blank.features)(inputs))
        predicted = np.asarray(eqx.filter_jit(blank.chain.states)(inputs))
        residual = samples.targets - share * predicted
        scales = np.array([blank.unit] * 3 + [AXIS_UNIT] * 3, residual.dtype)
        outputs = (residual / scales).reshape(len(residual), -1)
        kinds = self._kinds(blank.chain)
        kernels = fit_kernels(features, outputs, kinds, self.points)
        return replace(blank, kernels=kernels)

    def _uncertainty(self, model: LocalC2S, split: Split, arm: ArmSpec) -> Uncertainty:
        """Predictive standard deviation from the held-out samples."""
        training = _place(model, split.training)
        held_out = _place(model, split.validation)
        distances = _distances(model, split.validation)
        return fit_uncertainty(training, held_out, distances, self.few, arm.length)

    def _kinds(self, chain: ChainC2S) -> Float[np.ndarray, "features kinds"]:
        """Groups of features with a common length scale: by place, and by kind."""
        operators = chain.hysteresis.operators
        modules = len(chain.body.lengths)
        places = 3 * modules
        seen = 1 + len(operators.widths[EVERY_OTHER]) + len(operators.shares)
        module, kind, axis = np.unravel_index(
            np.arange(places * seen), (modules, seen, 3)
        )
        return np.hstack([np.eye(places)[3 * module + axis], np.eye(seen)[kind]])


def _reach(data: TrainingData) -> float:
    """Largest displacement over the cable radius, or bend [rad]; it scales the plays."""
    if data.displacements is not None:
        return max(float(np.abs(data.displacements).max()), MIN_REACH)
    return max(
        float(np.arccos(np.clip(np.min(data.sensed[..., 2]), -1.0, 1.0))), MIN_REACH
    )


def _all_samples(split: Split) -> Samples:
    """All samples of a split."""
    parts = split.training, split.validation, split.test
    inputs = np.concatenate([part.inputs["configurations"] for part in parts])
    targets = np.concatenate([part.targets for part in parts])
    return Samples({"configurations": inputs}, targets)


def _place(model: LocalC2S, samples: Samples) -> Float[np.ndarray, "samples features"]:
    """Features of the predictive standard deviation, without hysteresis."""
    displacements = samples.inputs["configurations"][:, :, 0]
    return np.asarray(model.place(jnp.asarray(displacements)))


def _distances(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples modules"]:
    """Distance of true from predicted end points [m]."""
    states = predict_states(model, jnp.asarray(samples.inputs["configurations"]))
    return np.linalg.norm(
        np.asarray(states)[..., :3] - samples.targets[..., :3], axis=-1
    )


def _loss(model: LocalC2S, samples: Samples) -> float:
    return float(np.nanmean(_distances(model, samples) ** 2))
