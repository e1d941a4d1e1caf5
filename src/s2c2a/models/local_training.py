"""Training of the forward model of the recipe `best`: the chain, then its residual.

The chain is trained first, then a Gaussian process is fitted to its residual. Samples
that neither the chain nor a first fit has seen give its deviation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.components import Ranges
from s2c2a.data import CollectOptions
from s2c2a.data.windows import Samples, Split, forward_samples, known_samples
from s2c2a.models.chain import LENGTH_UNIT, ChainC2S
from s2c2a.models.chain_training import (
    ChainOptions,
    hysteresis_inputs,
    hysteresis_samples,
    predict_states,
    predicted_targets,
)
from s2c2a.models.data_region import DataRegion, fit_region
from s2c2a.models.local import EVERY_OTHER, LocalC2S
from s2c2a.models.prior import pooled
from s2c2a.models.residual_process import ResidualProcess, fit_process
from s2c2a.models.transfer import babbling_data, interpolation_weights
from s2c2a.spaces import POSITION
from s2c2a.training.fit import FitOptions, FitResult, TrainingProgress, quiet
from s2c2a.training.trained import Pretrained, Trained, TrainingData, evaluated

FULL_BEND = 0.82  # rad; largest bend of the data for which `play_widths` hold
MIN_REACH = 1e-3  # rad; for recordings with little motion
HELD_OUT = "held-out samples"


@dataclass(frozen=True)
class LocalOptions(ChainOptions):
    """Options of the chain and of the process.

    Attributes:
        play_widths: half-widths of the play operators, in parts of the cable radius
            [rad], for data with bends up to `FULL_BEND`; they scale with the largest
            bend of the data.
        points: number of inducing points of the process.
        few: number of inducing points of the region of the data.
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
    points: int = 512
    few: int = 64
    limits: ClassVar[Ranges] = {
        **ChainOptions.limits,
        "points": (8, 10_000),
        "few": (4, 1000),
    }

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> LocalC2S:  # type: ignore[override]
        """See `ForwardOptions`: the chain before training, and a process without samples."""
        chain = super().untrained(arm, key)
        outputs = 6 * arm.module_count
        process = ResidualProcess.none(len(_kinds(chain)), outputs, self.points)
        region = DataRegion.everywhere(3 * arm.module_count, self.few)
        return LocalC2S(chain, process, region, unit=LENGTH_UNIT * arm.length)

    def train(  # type: ignore[override]
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain, then its residual."""
        chain = self._chain_options(data).train(data, fit, key, progress)
        return self._with_process(chain, data, key)

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
        trained = self._with_process(chain, data, key)
        # plans may also use the region of the first arm's data
        network = replace(trained.network, region=model.region)
        return replace(trained, network=network)

    def pretrain(  # type: ignore[override]
        self,
        arms: Sequence[TrainingData],
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Pretrained[LocalC2S]:
        """See `ForwardOptions`: of the chain alone; a process belongs to one arm."""
        together = pooled(arms)
        options = self._chain_options(together)
        chain = options.pretrain(arms, fit, key, progress)
        model = replace(self.untrained(together.arm, key), chain=chain.mean.network)
        split = hysteresis_samples(model.chain, together)
        model = self._with_region(_with_deviations(model, split), split)
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
        """See `ForwardOptions`: the chain; a process belongs to one arm alone."""
        chain = super().adapted(model.chain, old, new, babbling, key)
        blank = self.untrained(new, key)
        # a longer arm errs by more, in proportion: outputs are in units of its length
        weights = interpolation_weights(old.module_count, new.module_count)
        scale = weights @ np.asarray(model.process.scale).reshape(-1, 6)
        process = replace(blank.process, scale=jnp.asarray(scale.ravel(), jnp.float32))
        adapted = replace(blank, chain=chain, process=process, region=model.region)
        if old.module_count == new.module_count:
            return adapted
        samples = hysteresis_samples(chain, babbling_data(new, babbling))
        return self._with_region(adapted, samples)

    def _with_process(
        self, result: Trained[ChainC2S], data: TrainingData, key: PRNGKeyArray
    ) -> Trained[LocalC2S]:
        """A trained chain with a process of its residual.

        The test error and the deviation are those of a process of the training samples
        alone; that of the model has all samples.
        """
        blank = replace(self.untrained(data.arm, key), chain=result.network)
        inputs = hysteresis_inputs(result.network, data)
        split = forward_samples(inputs, data.states, data.lengths)
        rate = data.arm.control_rate
        probe = _with_deviations(self._fitted(blank, split.training, rate), split)
        trained = evaluated(FitResult(probe, result.curve), predicted_targets, split)
        every = known_samples(inputs, data.states, data.lengths)
        model = self._with_region(self._fitted(blank, every, rate), split)
        process = replace(model.process, scale=probe.process.scale)
        errors = _tip_errors(probe, split.test)
        return replace(trained, network=replace(model, process=process), errors=errors)

    def _fitted(self, model: LocalC2S, samples: Samples, rate: float) -> LocalC2S:
        """The model with a process of what its chain leaves.

        Args:
            model: with a trained chain.
            samples: in order of time.
            rate: of the samples [Hz].
        """
        residual = _residual(model, samples)
        features = _features(model, samples)
        motion = _motion(features, round(rate))
        kinds = _kinds(model.chain)
        process = fit_process(features, residual, kinds, motion, self.points)
        return replace(model, process=process)

    def _with_region(self, model: LocalC2S, split: Split) -> LocalC2S:
        """The model with the region of the training samples."""
        training, held_out = (
            _region_features(model, part) for part in (split.training, split.validation)
        )
        return replace(model, region=fit_region(training, held_out, self.few))


def _with_deviations(model: LocalC2S, split: Split) -> LocalC2S:
    """The model with the deviation that its errors on held-out samples show."""
    held_out = _joined(split.validation, split.test)
    features = _features(model, held_out)
    errors = _residual(model, held_out) - np.asarray(_means(model, features))
    process = model.process.with_deviations_of(features, errors)
    return replace(model, process=process)


def _kinds(chain: ChainC2S) -> Float[np.ndarray, "features kinds"]:
    """Groups of features that share a factor of their length scales (`fit_kernels`).

    One group for each component of a module's bend and its common displacement, and one
    for each input of the hysteresis.
    """
    operators = chain.hysteresis.operators
    modules = len(chain.body.lengths)
    components = 3 * modules
    inputs = 1 + len(operators.widths[EVERY_OTHER])
    module, number, axis = np.unravel_index(
        np.arange(components * inputs), (modules, inputs, 3)
    )
    component = np.eye(components)[3 * module + axis]
    return np.hstack([component, np.eye(inputs)[number]])


def _features(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples features"]:
    inputs = jnp.asarray(samples.inputs["configurations"])
    return np.asarray(eqx.filter_jit(model.features)(inputs))


def _motion(
    features: Float[np.ndarray, "samples features"], steps: int
) -> Float[np.ndarray, " features"]:
    """Root mean square change of the features in so many steps, at least one."""
    steps = min(max(steps, 1), len(features) - 1)
    return np.sqrt(np.mean((features[steps:] - features[:-steps]) ** 2, axis=0))


@eqx.filter_jit
def _means(model: LocalC2S, features: Any) -> Float[Array, "samples outputs"]:
    return model.process(features)


def _residual(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples outputs"]:
    """What the chain leaves, in units of the outputs."""
    inputs = jnp.asarray(samples.inputs["configurations"])
    residual = samples.targets - np.asarray(eqx.filter_jit(model.chain.states)(inputs))
    units = np.array([model.unit] * 3 + [1.0] * 3, residual.dtype)
    return (residual / units).reshape(len(residual), -1)


def _region_features(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples features"]:
    """See `LocalC2S.region_features`; the first input is the displacement itself."""
    displacements = samples.inputs["configurations"][:, :, 0]
    return np.asarray(model.region_features(jnp.asarray(displacements)))


def _reach(data: TrainingData) -> float:
    """Largest displacement over the cable radius, or bend [rad].

    The half-widths of play operators are proportional to it.
    """
    if data.displacements is not None:
        return max(float(np.abs(data.displacements).max()), MIN_REACH)
    # the z component of a configuration is the cosine of its bend
    smallest_cosine = np.clip(np.min(data.sensed[..., 2]), -1.0, 1.0)
    return max(float(np.arccos(smallest_cosine)), MIN_REACH)


def _joined(*parts: Samples) -> Samples:
    inputs = np.concatenate([part.inputs["configurations"] for part in parts])
    targets = np.concatenate([part.targets for part in parts])
    return Samples({"configurations": inputs}, targets)


def _tip_errors(model: LocalC2S, samples: Samples) -> dict[str, float]:
    """Mean error of the tip on samples [m]; empty if it is unknown."""
    inputs = jnp.asarray(samples.inputs["configurations"])
    differences = np.asarray(predict_states(model, inputs)) - samples.targets
    distances = np.linalg.norm(differences[:, -1, POSITION], axis=-1)
    known = distances[np.isfinite(distances)]
    return {HELD_OUT: float(known.mean())} if len(known) else {}
