"""Training of the forward model of the recipe `best`: chain, kernels, uncertainty.

The chain is trained first, then kernels are fitted to its residual. Validation samples
choose the mixture of both, and a second training calibrates the uncertainty
(`models.calibration`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.components import Ranges
from s2c2a.data import CollectOptions
from s2c2a.data.windows import Samples, Split, validation_samples
from s2c2a.kinematics import bends_from_configurations
from s2c2a.models import calibration
from s2c2a.models.chain import LENGTH_UNIT, ChainC2S
from s2c2a.models.chain_training import (
    ChainOptions,
    hysteresis_inputs,
    hysteresis_samples,
    predict_states,
    predicted_targets,
    shortened,
)
from s2c2a.models.kernels import Kernels, fit_kernels
from s2c2a.models.local import EVERY_OTHER, LocalC2S
from s2c2a.models.prior import pooled
from s2c2a.models.transfer import babbling_data, interpolation_weights
from s2c2a.models.uncertainty import Uncertainty, fit_uncertainty
from s2c2a.spaces import POSITION
from s2c2a.training.fit import FitOptions, FitResult, TrainingProgress, quiet
from s2c2a.training.trained import Pretrained, Trained, TrainingData, evaluated

FULL_BEND = 0.82  # rad; largest bend of the data for which `play_widths` hold
MIN_REACH = 1e-3  # rad; for recordings with little motion
CALIBRATION_EPOCHS = 0.5  # of the training, for the model that calibrates errors
SHARES = 0.0, 0.5, 1.0  # of the chain whose residual is fitted
WEIGHTS = 0.5, 0.75, 1.0  # of the fitted residual


class Mixture(NamedTuple):
    """How the local model is mixed from chain and kernels.

    Attributes:
        share: of the chain whose residual the kernels are fitted to.
        weight: of the kernels.
    """

    share: float
    weight: float


CHAIN_ALONE = Mixture(1.0, 0.0)


@dataclass(frozen=True)
class LocalOptions(ChainOptions):
    """Options of the chain and of the local model.

    Attributes:
        play_widths: half-widths of the play operators, in parts of the cable radius
            [rad], for data with bends up to `FULL_BEND`; they scale with the largest
            bend of the data.
        points: number of inducing points of the kernels.
        few: number of inducing points of the predictive standard deviation.
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
    limits: ClassVar[Ranges] = {
        **ChainOptions.limits,
        "points": (8, 10_000),
        "few": (4, 1000),
    }

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> LocalC2S:  # type: ignore[override]
        """See `ForwardOptions`: the chain before training, without kernels."""
        chain = super().untrained(arm, key)
        modules = arm.module_count
        kernels = Kernels.unfitted(len(_kinds(chain)), 6 * modules, self.points)
        return LocalC2S(
            chain,
            kernels,
            share=jnp.ones((modules, 6)),
            uncertainty=Uncertainty.none(3 * modules, self.few, modules),
            unit=LENGTH_UNIT * arm.length,
        )

    def train(  # type: ignore[override]
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain, then its residual, then the calibration."""
        chain = self._chain_options(data).train(data, fit, key, progress)
        trained, mixture = self._with_local(chain, data, key)
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
        progress: TrainingProgress = quiet,
        spread: ChainC2S | None = None,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then its residual."""
        chain = super().resume_training(model.chain, data, fit, key, progress, spread)
        trained, _mixture = self._with_local(chain, data, key)
        error = trained.network.uncertainty.interpolation_error
        # plans may also use the region of the first arm's data
        uncertainty = replace(model.uncertainty, interpolation_error=error)
        network = replace(trained.network, uncertainty=uncertainty)
        return replace(trained, network=network)

    def pretrain(  # type: ignore[override]
        self,
        arms: Sequence[TrainingData],
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
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
        uncertainty = uncertainty.with_errors(
            np.asarray(scaled @ known.interpolation_error),
            np.asarray(scaled @ known.speed_error),
            np.asarray(scaled @ known.extrapolation_error),
        )
        return replace(adapted, uncertainty=uncertainty)

    def _with_local(
        self, result: Trained[ChainC2S], data: TrainingData, key: PRNGKeyArray
    ) -> tuple[Trained[LocalC2S], Mixture]:
        """A trained chain with the kernels that predict held-out samples best."""
        blank = replace(self.untrained(data.arm, key), chain=result.network)
        split = hysteresis_samples(result.network, data)
        mixture, best = self._best_mixture(blank, split)
        model = replace(best, uncertainty=self._uncertainty(best, split, data.arm))
        trained = evaluated(FitResult(model, result.curve), predicted_targets, split)
        if mixture == CHAIN_ALONE:
            return trained, mixture
        # fit again, with all samples; the closeness of held-out ones is that of the first
        # fit, since they may be inducing points now
        fitted = self._with_kernels(model, _all_samples(split), mixture.share)
        usual = best.kernels.usual_closeness
        kernels = replace(fitted.kernels, usual_closeness=usual)
        final = replace(fitted, kernels=kernels)
        return replace(trained, network=final.mixed(*mixture, _known(split))), mixture

    def _best_mixture(self, blank: LocalC2S, split: Split) -> tuple[Mixture, LocalC2S]:
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

    def _mixed(self, blank: LocalC2S, split: Split, mixture: Mixture) -> LocalC2S:
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
        kinds = _kinds(blank.chain)
        kernels = fit_kernels(features, targets, kinds, self.points)
        return replace(blank, kernels=kernels)

    def _calibrated(
        self,
        trained: Trained[LocalC2S],
        mixture: Mixture,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
    ) -> Trained[LocalC2S]:
        """The model with errors of another one that does not see parts of the data."""
        groups = calibration.held_out_groups(data)
        seen = replace(data, hidden=calibration.union(groups))
        probe = self._probe(seen, mixture, fit, key)
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

    def _probe(
        self, seen: TrainingData, mixture: Mixture, fit: FitOptions, key: PRNGKeyArray
    ) -> LocalC2S:
        """A model from a shorter training that does not see the hidden samples."""
        short = shortened(fit, CALIBRATION_EPOCHS)
        chain = self._chain_options(seen).train(seen, short, key)
        blank = replace(self.untrained(seen.arm, key), chain=chain.network)
        split = _seen(hysteresis_samples(chain.network, seen))
        probe = self._mixed(blank, split, mixture)
        return replace(probe, uncertainty=self._uncertainty(probe, split, seen.arm))

    def _errors(
        self,
        probe: LocalC2S,
        data: TrainingData,
        groups: dict[str, calibration.Mask],
    ) -> dict[str, calibration.GroupErrors]:
        """Errors of a model on validation samples, and on groups that it has not seen."""
        inputs = hysteresis_inputs(probe.chain, data)
        bends = bends_from_configurations(jnp.asarray(data.sensed))
        speeds = calibration.bend_speeds(np.asarray(bends))
        # the first input is the displacement itself
        features = probe.extrapolation_features(jnp.asarray(inputs[:, :, :, 0]))
        extrapolation = np.asarray(probe.uncertainty.extrapolation(features))
        differences = self.predictions(probe, data) - data.states
        distances = np.linalg.norm(differences[..., POSITION], axis=-1)
        inside = validation_samples(data.states, data.lengths)
        inside &= ~calibration.union(groups)
        return {
            name: calibration.GroupErrors(
                distances[mask], speeds[mask], extrapolation[mask]
            )
            for name, mask in {calibration.INSIDE: inside, **groups}.items()
        }

    def _uncertainty(self, model: LocalC2S, split: Split, arm: ArmSpec) -> Uncertainty:
        """Predictive standard deviation from the held-out samples."""
        training = _extrapolation_features(model, split.training)
        held_out = _extrapolation_features(model, split.validation)
        distances = _distances(model, split.validation)
        return fit_uncertainty(training, held_out, distances, self.few, arm.length)


def _kinds(chain: ChainC2S) -> Float[np.ndarray, "features kinds"]:
    """Groups of features that share a factor of their length scales (`fit_kernels`).

    One group for each component of a module's bend and its common displacement, and one
    for each input of the hysteresis.
    """
    operators = chain.hysteresis.operators
    modules = len(chain.body.lengths)
    components = 3 * modules
    inputs = 1 + len(operators.widths[EVERY_OTHER]) + len(operators.shares)
    module, number, axis = np.unravel_index(
        np.arange(components * inputs), (modules, inputs, 3)
    )
    component = np.eye(components)[3 * module + axis]
    return np.hstack([component, np.eye(inputs)[number]])


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
    scales = np.array([model.unit] * 3 + [1.0] * 3, residual.dtype)
    return (residual / scales).reshape(len(residual), -1)


def _reach(data: TrainingData) -> float:
    """Largest displacement over the cable radius, or bend [rad].

    The half-widths of play operators are proportional to it.
    """
    if data.displacements is not None:
        return max(float(np.abs(data.displacements).max()), MIN_REACH)
    # the z component of a configuration is the cosine of its bend
    smallest_cosine = np.clip(np.min(data.sensed[..., 2]), -1.0, 1.0)
    return max(float(np.arccos(smallest_cosine)), MIN_REACH)


def _seen(split: Split) -> Split:
    """The samples with a known target; hidden ones have none."""
    known = [np.isfinite(part.targets).any(axis=(1, 2)) for part in split.parts]
    return Split(*map(Samples.rows, split.parts, known))


def _all_samples(split: Split) -> Samples:
    """All samples of a split."""
    inputs = np.concatenate([part.inputs["configurations"] for part in split.parts])
    targets = np.concatenate([part.targets for part in split.parts])
    return Samples({"configurations": inputs}, targets)


def _extrapolation_features(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples features"]:
    """See `LocalC2S.extrapolation_features`."""
    displacements = samples.inputs["configurations"][:, :, 0]
    return np.asarray(model.extrapolation_features(jnp.asarray(displacements)))


def _distances(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples modules"]:
    """Distance of true from predicted end points [m]."""
    states = predict_states(model, jnp.asarray(samples.inputs["configurations"]))
    differences = np.asarray(states) - samples.targets
    return np.linalg.norm(differences[..., POSITION], axis=-1)


def _loss(model: LocalC2S, samples: Samples) -> float:
    """Mean squared position error of the module ends [m^2]."""
    return float(np.nanmean(_distances(model, samples) ** 2))
