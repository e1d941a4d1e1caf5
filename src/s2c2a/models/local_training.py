"""Training of the forward model of the recipe `best`: the chain, then its residual.

The chain is trained first, then a Gaussian process is fitted to its residual. Samples
that neither the chain nor a first fit has seen give its deviation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data.nominal_plans import LENGTH_UNIT
from s2c2a.data.windows import APART, Samples, Split, forward_samples, known_samples
from s2c2a.models.arrays import FeatureRows, OutputRows
from s2c2a.models.chain import ChainC2S
from s2c2a.models.chain_training import (
    FEW_EPOCHS,
    ChainOptions,
    along_inputs,
    hysteresis_inputs,
    hysteresis_samples,
    part_of,
    predicted_targets,
    ridge_of,
    shortened,
    train_further,
)
from s2c2a.models.data_region import DataRegion, fit_region
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.local import EVERY_OTHER, LocalC2S
from s2c2a.models.prior import pooled
from s2c2a.models.residual_process import GAP, ResidualProcess, fit_process
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import POSITION
from s2c2a.training.fit import FitOptions, TrainingProgress, quiet
from s2c2a.training.trained import Trained, TrainingData, evaluated

Part = tuple[FeatureRows, OutputRows]
FULL_BEND = 0.82  # rad; largest bend of the data for which `play_widths` hold
MIN_REACH = 1e-3  # rad; for recordings with little motion
HELD_OUT = "held-out samples"
# standard errors by which a process, or a free network, has to reduce squared errors: in
# nine trainings on noise of 0.1 to 0.4 m no process did, and a free network errs more
# beyond the data, on the largest pulls of `opencr_v4` by 24 instead of 10 mm
SURE = 1.0
NOISES = (1.0, 3.0, 10.0)  # over that of samples that the chain has seen


@dataclass(frozen=True)
class LocalOptions(ChainOptions):
    """Options of the chain and of the process.

    The play widths are for data with bends up to `FULL_BEND`, and scale with the largest.

    Attributes:
        points: number of inducing points of the process.
        few: number of inducing points of the region of the data.
    """

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
        """See `ForwardOptions`: the chain, then its residual, then all samples.

        Samples that a chain has seen show nothing of its errors. So the hyperparameters
        of the process, and whether it and a free network have any use, are of chains
        that have not seen all.
        """
        options = self._chain_options(data)
        total = 2 * fit.max_epochs
        # the size of the first network counts, that of the second does not
        bound = options.train(data, fit, key, part_of(progress, 0, total))
        fewer = shortened(fit, FEW_EPOCHS)
        split = hysteresis_samples(bound.network, data)
        free = train_further(bound.network, split, jnp.zeros(()), fewer, key)
        judged = [self._with_process(each, data, key) for each in (bound, free)]
        (best, errors), (other, others) = judged
        is_free = is_smaller(others, errors, SURE)
        best = other if is_free else best
        second = part_of(progress, fit.max_epochs, total)
        chain = best.network.chain
        samples = hysteresis_inputs(chain, data), data.states, data.lengths
        # also those that were held out before
        split = replace(forward_samples(*samples), training=known_samples(*samples))
        ridge = jnp.zeros(()) if is_free else ridge_of(split.training)
        whole = train_further(chain, split, ridge, fit, key, second).network
        inputs = hysteresis_inputs(whole, data)
        model = replace(best.network, chain=whole)
        network = _given(model, known_samples(inputs, data.states, data.lengths))
        return replace(best, network=network)

    def deviations(
        self, model: ForwardModel, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules"]:
        """See `ForwardOptions`; uses cable displacements where they were recorded."""
        return along_inputs(model, data, "std_at")

    def _chain_options(self, data: TrainingData) -> ChainOptions:
        """Options of the chain, with widths of play operators for the data."""
        widths = tuple(width * _reach(data) / FULL_BEND for width in self.play_widths)
        return ChainOptions(
            self.hidden, self.depth, widths, self.creep_times, self.statics
        )

    def resume_training(  # type: ignore[override]
        self,
        model: LocalC2S,
        spread: ChainC2S,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then its residual."""
        chain = super().resume_training(model.chain, spread, data, fit, key, progress)
        trained, _ = self._with_process(chain, data, key)
        # plans may also use the region of the prior's data
        network = replace(trained.network, region=model.region)
        return replace(trained, network=network)

    def pretrain(  # type: ignore[override]
        self,
        arms: Sequence[TrainingData],
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: of the chain alone; a process belongs to one arm."""
        together = pooled(arms)
        options = self._chain_options(together)
        chain = options.pretrain(arms, fit, key, progress)
        model = replace(self.untrained(together.arm, key), chain=chain.network)
        split = hysteresis_samples(model.chain, together)
        process = _judged(model, split).process
        model = self._with_region(replace(model, process=process), split)
        return Trained(model, chain.curve, chain.percent, spread=chain.spread)

    def _with_process(
        self, result: Trained[ChainC2S], data: TrainingData, key: PRNGKeyArray
    ) -> tuple[Trained[LocalC2S], OutputRows]:
        """A trained chain with a process of its residual, if it predicts better with it.

        Samples that the chain has not seen, half of them unseen by the process, too,
        decide. They also give the deviation and the error that are stated.

        Returns:
            Chain and process, and their errors on these samples.
        """
        blank = replace(self.untrained(data.arm, key), chain=result.network)
        inputs = hysteresis_inputs(result.network, data)
        split = forward_samples(inputs, data.states, data.lengths, APART)
        every = known_samples(inputs, data.states, data.lengths)
        features = _features(blank, every)
        # root mean square change of the features in a second
        steps = min(max(round(data.arm.control_rate), 1), len(features) - 1)
        motion = np.sqrt(np.mean((features[steps:] - features[:-steps]) ** 2, axis=0))
        fitted = fit_process(
            features, _residual(blank, every), _kinds(blank.chain), motion, self.points
        )
        best = _judged(replace(blank, process=fitted), split)
        model = replace(blank, process=best.process)
        unseen = _given(model, Samples.joined([split.training, split.validation]))
        trained = evaluated(unseen, result.curve, predicted_targets, split)
        network = self._with_region(model, split)
        trained = replace(trained, network=network, errors=best.tip_errors)
        return trained, best.errors

    def _with_region(self, model: LocalC2S, split: Split) -> LocalC2S:
        """The model with the region of the training samples."""
        features = []
        for part in (split.training, split.validation):
            # the first input is the displacement itself
            displacements = jnp.asarray(part.inputs["configurations"][:, :, 0])
            features.append(np.asarray(model.region_features(displacements)))
        training, held_out = features
        return replace(model, region=fit_region(training, held_out, self.few))


class _Judgment(NamedTuple):
    """Chain and process on samples that they have not seen.

    Attributes:
        process: with the deviations of these samples as its scale.
        errors: in units of the outputs, shape (samples, outputs).
        tip_errors: mean error of the tip [m]; empty if it is unknown.
        surprise: sum over outputs of the mean negative log likelihood, without constants.
    """

    process: ResidualProcess
    errors: OutputRows
    tip_errors: dict[str, float]
    surprise: float


def _judged(model: LocalC2S, split: Split) -> _Judgment:
    """Judge chain and process, with the noise that makes held-out samples the likeliest.

    The chain predicts alone unless the process reduces its squared error.
    """
    parts = [(_features(model, part), _residual(model, part)) for part in split.parts]
    fitted = model.process
    sizes = len(fitted.center), len(fitted.scale), len(fitted.points)
    alone = _judge(ResidualProcess.none(*sizes), parts, model.unit)
    noises = [replace(fitted, noise=each * fitted.noise) for each in NOISES]
    judged = [_judge(process, parts, model.unit) for process in noises]
    better = [each for each in judged if is_smaller(each.errors, alone.errors, SURE)]
    return min([alone, *better], key=attrgetter("surprise"))


def _judge(process: ResidualProcess, parts: Sequence[Part], unit: float) -> _Judgment:
    """Judge a process on validation and test samples.

    It has the samples of training and of the other of these two.

    Args:
        process: with its hyperparameters.
        parts: features and residuals of training, validation and test samples.
        unit: of the residuals of positions [m].
    """
    training, *held_out = parts
    remaining = []
    deviations = []
    for (features, residual), other in zip(held_out, held_out[::-1], strict=True):
        given = process.given(*map(np.concatenate, zip(training, other, strict=True)))
        mean = np.asarray(given(jnp.asarray(features, jnp.float32)))
        remaining.append(residual - mean)
        deviations.append(given.deviations(features))
    errors = np.concatenate(remaining)
    deviation = np.concatenate(deviations)[:, None]
    relative = errors / deviation
    known = np.isfinite(relative)
    count = np.maximum(known.sum(axis=0), 1)
    scale = np.sqrt(np.nansum(relative**2, axis=0) / count)
    ends = errors.reshape(len(errors), -1, 6)[:, -1, POSITION]
    distances = unit * np.linalg.norm(ends, axis=-1)
    seen = distances[np.isfinite(distances)]
    tip_errors = {HELD_OUT: float(seen.mean())} if len(seen) else {}
    # of each output, over the samples that have it
    logs = (known * np.log(deviation)).sum(axis=0) / count
    surprise = logs.sum() + np.log(scale[scale > 0.0]).sum()
    process = replace(process, scale=jnp.asarray(scale, jnp.float32))
    return _Judgment(process, errors, tip_errors, float(surprise))


def _given(model: LocalC2S, samples: Samples) -> LocalC2S:
    """The model with a process of these samples alone."""
    process = model.process.given(_features(model, samples), _residual(model, samples))
    return replace(model, process=process)


def is_smaller(
    errors: Float[np.ndarray, "samples *outputs"],
    others: Float[np.ndarray, "samples *outputs"],
    sure: float,
) -> bool:
    """Whether squared errors are smaller, by so many standard errors as are `sure`.

    Blocks of samples count once, since neighbors in time are alike.
    """
    gains = np.nansum((others**2 - errors**2).reshape(len(errors), -1), axis=1)
    blocks = np.array_split(gains, max(2, len(gains) // GAP))
    means = [block.mean() for block in blocks]
    standard_error = np.std(means, ddof=1) / np.sqrt(len(means))
    return bool(np.mean(means) > sure * standard_error)


def _kinds(chain: ChainC2S) -> Float[np.ndarray, "features kinds"]:
    """Groups of features that share a factor of their length scales (`fit_process`).

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


def _features(model: LocalC2S, samples: Samples) -> FeatureRows:
    inputs = jnp.asarray(samples.inputs["configurations"])
    return np.asarray(eqx.filter_jit(model.features)(inputs))


def _residual(model: LocalC2S, samples: Samples) -> OutputRows:
    """What the chain leaves, in units of the outputs."""
    inputs = jnp.asarray(samples.inputs["configurations"])
    residual = samples.targets - np.asarray(eqx.filter_jit(model.chain.states)(inputs))
    units = np.array([model.unit] * 3 + [1.0] * 3, residual.dtype)
    return (residual / units).reshape(len(residual), -1)


def _reach(data: TrainingData) -> float:
    """Largest displacement over the cable radius, or bend [rad].

    The half-widths of play operators are proportional to it.
    """
    if data.displacements is not None:
        return max(float(np.abs(data.displacements).max()), MIN_REACH)
    # the z component of a configuration is the cosine of its bend
    smallest_cosine = np.clip(np.min(data.sensed[..., 2]), -1.0, 1.0)
    return max(float(np.arccos(smallest_cosine)), MIN_REACH)
