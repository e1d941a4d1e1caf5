"""The forward model of the recipe `best`: the chain, and kernels for its residual.

The chain extrapolates. Near the data, a local model (`Kernels`) predicts the residual of
the chain from the displacements, their hysteresis, and their lag. Away from the data it
fades out, so that the chain predicts alone. `Uncertainty` estimates the errors of both.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions
from s2c2a.data.windows import Samples, Split, validation_samples
from s2c2a.kinematics import bends_from_configurations, limit_lengths
from s2c2a.kinematics.bends import squared_norm
from s2c2a.models import calibration
from s2c2a.models.cables import HysteresisMemory
from s2c2a.models.chain import ChainC2S
from s2c2a.models.chain_training import (
    ChainOptions,
    hysteresis_inputs,
    hysteresis_samples,
    predict_states,
    predicted_targets,
)
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.kernels import Kernels, fit_kernels
from s2c2a.models.prior import pooled
from s2c2a.models.transfer import babbling_data, interpolation_weights
from s2c2a.models.uncertainty import Uncertainty, fit_uncertainty
from s2c2a.training.fit import FitOptions, FitResult, Progress, check_limits, quiet
from s2c2a.training.trained import Pretrained, Trained, TrainingData, evaluated

# scales of the outputs, in parts of the arm's length and of axes
UNIT = 0.4
AXIS_UNIT = 1.0
FULL_BEND = 0.82  # rad; bend at which `play_widths` apply
MIN_REACH = 1e-3  # rad; for recordings with little motion
NEARBY = 0.2  # rad; radius within which the tangent holds
CALIBRATION_EPOCHS = 0.5  # of the training, for the model that calibrates errors
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
        support: of the local model, there.
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
        share: weight of the chain in every output of the local model, shape (modules, 6).
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
        support = self.kernels.support(features)
        tangent = Tangent(bends, features, value, slopes, support)
        return replace(self, chain=chain, tangent=tangent)

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
            return self._locally_corrected(states, self.features(inputs))
        outputs = self._along(self.tangent, configurations, memory)
        return self._corrected(states, outputs, self.tangent.support)

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
        displacements = self.chain.body.displacements(configurations)
        extrapolation = self.uncertainty.extrapolation(self.place(displacements))
        moved = self.chain.body.bends(memory.last - memory.previous)
        speed = jnp.sqrt(jnp.mean(squared_norm(moved), axis=-1))
        return self.uncertainty.std(extrapolation, speed)

    def extrapolation(self, configurations: Float[Array, "*batch modules 3"]) -> Array:
        """See `ForwardModel`."""
        return self.uncertainty.meters(
            self.place(self.chain.body.displacements(configurations))
        )

    def states(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch modules 6"]:
        """States for inputs of the hysteresis model. Training calls this."""
        return self._locally_corrected(self.chain.states(inputs), self.features(inputs))

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
        units = jnp.repeat(jnp.array([self.unit, AXIS_UNIT]), 3)
        change = (self.share - 1.0) * states + units * residual
        blended = states + support[..., None, None] * change
        axes = blended[..., 3:]
        return jnp.concatenate(
            [
                blended[..., :3],
                axes / jnp.linalg.norm(axes, axis=-1, keepdims=True),
            ],
            axis=-1,
        )


@dataclass(frozen=True)
class LocalOptions(ChainOptions):
    """Options of the chain and of the local model.

    Attributes:
        points: kernel centers.
        few: centers of the predictive standard deviation.
        calibrate: whether a second, shorter training calibrates that deviation
            (`models.calibration`).
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
    calibrate: bool = True
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
        """See `ForwardOptions`: the chain first, then its residual, then the errors."""
        chain = self._chain_options(data)
        trained, mixture = self._with_local(
            chain.train(data, fit, key, progress), data, key
        )
        if not self.calibrate:
            return trained
        return self._calibrated(trained, mixture, data, fit, key)

    def _chain_options(self, data: TrainingData) -> ChainOptions:
        """Options of the chain, with widths of play operators for the data."""
        widths = tuple(width * _reach(data) / FULL_BEND for width in self.play_widths)
        return ChainOptions(
            self.hidden, self.depth, widths, self.creep_times, self.statics
        )

    def resume_training(  # type: ignore[override]
        self,
        model: LocalC2S,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
        spread: ChainC2S | None = None,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then its residual."""
        chain = super().resume_training(model.chain, data, fit, key, progress, spread)
        trained, _mixture = self._with_local(chain, data, key)
        error = trained.network.uncertainty.interpolation_error
        uncertainty = replace(model.uncertainty, interpolation_error=error)
        network = replace(trained.network, uncertainty=uncertainty)
        return replace(trained, network=network)

    def pretrain(  # type: ignore[override]
        self,
        arms: Sequence[TrainingData],
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Pretrained[LocalC2S]:
        """See `ForwardOptions`: of the chain alone; kernels belong to one arm."""
        together = pooled(arms)
        options = self._chain_options(together)
        chain = options.pretrain(arms, fit, key, progress)
        model = self.untrained(together.arm, key)
        model = replace(model, chain=chain.mean.network)
        samples = hysteresis_samples(model.chain, together)
        uncertainty = self._uncertainty(model, samples, together.arm)
        model = replace(model, uncertainty=uncertainty)
        mean = Trained(model, chain.mean.curve, chain.mean.percent)
        return Pretrained(mean, chain.spread)

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
        scaled = jnp.asarray(weights) * new.length / old.length
        known = model.uncertainty
        errors = known.interpolation_error, known.speed_error, known.extrapolation_error
        uncertainty = uncertainty.with_errors(
            *(np.asarray(scaled @ error) for error in errors)
        )
        return replace(adapted, uncertainty=uncertainty)

    def _with_local(
        self, result: Trained[ChainC2S], data: TrainingData, key: PRNGKeyArray
    ) -> "tuple[Trained[LocalC2S], Mixture]":
        """A trained chain with the kernels that predict held-out samples best."""
        blank = replace(self.untrained(data.arm, key), chain=result.network)
        split = hysteresis_samples(result.network, data)
        mixture, best = self._best_mixture(blank, split)
        model = replace(best, uncertainty=self._uncertainty(best, split, data.arm))
        trained = evaluated(FitResult(model, result.curve), predicted_targets, split)
        if mixture == CHAIN_ALONE:
            return trained, mixture
        # fit again, with the held-out samples, which are near all points now
        fitted = self._with_kernels(model, _all_samples(split), mixture.share)
        usual = best.kernels.usual_closeness
        kernels = replace(fitted.kernels, usual_closeness=usual)
        final = replace(fitted, kernels=kernels)
        return replace(trained, network=final.mixed(*mixture, _known(split))), mixture

    def _best_mixture(
        self, blank: LocalC2S, split: Split
    ) -> "tuple[Mixture, LocalC2S]":
        """The mixture of chain and kernels with the least error on validation samples."""
        candidates = {CHAIN_ALONE: blank}  # first, so that it wins ties
        for share in SHARES:
            fitted = self._mixed(blank, split, Mixture(share, 1.0))
            for weight in WEIGHTS:
                mixed = fitted.mixed(share, weight, _known(split))
                candidates[Mixture(share, weight)] = mixed
        losses = {
            mixture: _loss(model, split.validation)
            for mixture, model in candidates.items()
        }
        best = min(losses, key=lambda mixture: losses[mixture])
        return best, candidates[best]

    def _mixed(self, blank: LocalC2S, split: Split, mixture: "Mixture") -> LocalC2S:
        """A mixture of chain and kernels, which are fitted to the training samples."""
        if mixture == CHAIN_ALONE:
            return blank
        fitted = self._with_kernels(blank, split.training, mixture.share)
        held_out = _features(blank, split.validation)
        kernels = fitted.kernels.with_usual_closeness(held_out)
        return replace(fitted, kernels=kernels).mixed(*mixture, _known(split))

    def _with_kernels(
        self, blank: LocalC2S, samples: Samples, share: float
    ) -> LocalC2S:
        """The model with kernels fitted to what a share of the chain leaves."""
        features = _features(blank, samples)
        targets = _residual(blank, samples, share)
        kinds = self._kinds(blank.chain)
        kernels = fit_kernels(features, targets, kinds, self.points)
        return replace(blank, kernels=kernels)

    def _calibrated(
        self,
        trained: Trained[LocalC2S],
        mixture: "Mixture",
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
    ) -> Trained[LocalC2S]:
        """The model with errors of another one that does not see parts of the data."""
        groups = calibration.held_out_groups(data)
        seen = replace(data, hidden=calibration.union(groups))
        epochs = max(1, round(CALIBRATION_EPOCHS * fit.max_epochs))
        short = replace(fit, max_epochs=epochs, patience=epochs)
        chain = self._chain_options(data).train(seen, short, key)
        blank = replace(self.untrained(data.arm, key), chain=chain.network)
        split = hysteresis_samples(chain.network, seen)
        probe = self._mixed(blank, split, mixture)
        probe = replace(probe, uncertainty=self._uncertainty(probe, split, data.arm))
        errors = self._errors(probe, data, groups)
        network = trained.network
        uncertainty = calibration.calibrated(
            network.uncertainty, probe.uncertainty, errors
        )
        network = replace(network, uncertainty=uncertainty)
        tip_errors = {
            name: group.tip_error
            for name, group in errors.items()
            if group.is_large_enough
        }
        return replace(trained, network=network, errors=tip_errors)

    def _errors(
        self,
        probe: LocalC2S,
        data: TrainingData,
        groups: dict[str, calibration.Mask],
    ) -> dict[str, calibration.Errors]:
        """Errors of a model on validation samples, and on groups that it has not seen."""
        inputs = hysteresis_inputs(probe.chain, data)
        bends = bends_from_configurations(jnp.asarray(data.sensed))
        speeds = calibration.bend_speeds(np.asarray(bends))
        places = probe.place(jnp.asarray(inputs[:, :, :, 0]))
        extrapolation = np.asarray(probe.uncertainty.extrapolation(places))
        differences = self.predictions(probe, data) - data.states
        distances = np.linalg.norm(differences[..., :3], axis=-1)
        inside = validation_samples(data.states, data.lengths)
        inside &= ~calibration.union(groups)
        return {
            name: calibration.Errors(distances[mask], speeds[mask], extrapolation[mask])
            for name, mask in {calibration.INSIDE: inside, **groups}.items()
        }

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


class Mixture(NamedTuple):
    """How the local model is mixed from chain and kernels.

    Attributes:
        share: of the chain whose residual the kernels are fitted to.
        weight: of the kernels.
    """

    share: float
    weight: float


CHAIN_ALONE = Mixture(1.0, 0.0)


def _known(split: Split) -> Bool[np.ndarray, "modules 6"]:
    """Which outputs the data hold."""
    return np.isfinite(split.training.targets).any(axis=0)


def _features(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples features"]:
    inputs = jnp.asarray(samples.inputs["configurations"])
    return np.asarray(eqx.filter_jit(model.features)(inputs))


def _residual(
    model: LocalC2S, samples: Samples, share: float
) -> Float[np.ndarray, "samples outputs"]:
    """What a share of the chain leaves, in units of the outputs."""
    inputs = jnp.asarray(samples.inputs["configurations"])
    predicted = np.asarray(eqx.filter_jit(model.chain.states)(inputs))
    residual = samples.targets - share * predicted
    scales = np.array([model.unit] * 3 + [AXIS_UNIT] * 3, residual.dtype)
    return (residual / scales).reshape(len(residual), -1)


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
