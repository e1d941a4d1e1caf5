"""Options and training of the chain: hysteresis by least squares, then all together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data.nominal_plans import LENGTH_UNIT
from s2c2a.data.windows import EpisodeStates, Samples, Split, forward_samples
from s2c2a.kinematics import bends_from_states
from s2c2a.kinematics.bends import Scalar
from s2c2a.models.arrays import PerModule
from s2c2a.models.c2s import ForwardOptions
from s2c2a.models.cables import MAX_CREEP, Hysteresis, Operators, Viscoelasticity
from s2c2a.models.chain import OUTPUTS, ChainC2S
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.prior import mean_and_spread, pooled
from s2c2a.models.statics import Equilibrium
from s2c2a.models.trunk import Trunk
from s2c2a.plugins.components import Ranges
from s2c2a.training.fit import Batch, FitOptions, TrainingProgress, parameters, quiet
from s2c2a.training.trained import Trained, TrainingData, evaluated, known_error, train

NO_WEIGHT = -7.0  # before a softplus
AXIS_WEIGHT = 0.3  # of squared axis errors relative to squared position errors
DELAY = 0.1  # s; time constant of the delay filter
RIDGE = 0.2
"""Weight of the network's squared weights, over the number of samples.

Without it, a network errs more on motion beyond the data: chosen on `opencr_v4`, and on
three randomized arms with 4 and 36 episodes.
"""
PRIOR_PENALTY = 1e-5
"""Weight of the squared change of parameters over the spread of a prior.

Up to a factor the penalty is the negative logarithm of a normal density.
"""
ARM_PENALTY = 1e-3
"""Weight of the squared change from the joint model to that of one arm of a prior."""
JOINT_EPOCHS = 1 / 6
"""Of the training, for the joint model of a prior: its epochs have more batches."""
FEW_EPOCHS = 1 / 2
"""Of the training, for the few parameters of physics, or from a trained chain."""


@dataclass(frozen=True)
class ChainOptions(ForwardOptions):
    """Options of the chain: the forward model of `best` without its local model.

    Attributes:
        hidden: units of each hidden layer of the network.
        depth: number of hidden layers.
        play_widths: half-widths of the play operators, in parts of the cable radius
            [rad]; empty for no backlash.
        creep_times: time constants of the creep filters [s].
        statics: whether to model elastic cables that only pull, where the sensors are
            motor encoders; otherwise the network learns their effect.
    """

    hidden: int = 64
    depth: int = 2
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
    creep_times: tuple[float, ...] = (1.0, 3.0, 10.0, 30.0)
    statics: bool = True
    limits: ClassVar[Ranges] = {
        "hidden": (1, 4096),
        "depth": (1, 32),
        "play_widths": (1e-6, 10),
        "creep_times": (1e-6, 1e6),
    }

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ChainC2S:
        """The initial chain: no hysteresis, and a network with outputs near zero."""
        modules = arm.module_count
        cables = arm.cable_count
        # at lower rates the last reading models the delay
        delays = (DELAY,) if arm.control_period < DELAY else ()
        times = np.array([*delays, *self.creep_times])
        shares = jnp.asarray(1.0 - np.exp(-arm.control_period / times), jnp.float32)
        widths = jnp.asarray(self.play_widths, dtype=jnp.float32)
        play_weights = jnp.full((modules, len(widths) + 2, cables), NO_WEIGHT)
        hysteresis = Hysteresis(
            Operators(widths, shares),
            play_weights.at[:, 0].set(np.log(np.expm1(1.0))),
            jnp.zeros((modules, len(delays), cables)),
            Viscoelasticity.none(modules, len(self.creep_times), cables),
        )
        senses_pulling_cables = (
            arm.actuation == "displacement"
            and arm.sensing == "encoders"
            and arm.sensing_coupling is None
        )
        statics = bool(self.statics) and senses_pulling_cables
        features = modules * (2 + cables if statics else 2)
        network = eqx.nn.MLP(
            features, OUTPUTS * modules, self.hidden, self.depth, jax.nn.tanh, key=key
        )
        head = network.layers[-1]
        small = (0.01 * head.weight, jnp.zeros(head.weight.shape[0]))
        network = eqx.tree_at(
            lambda net: (net.layers[-1].weight, net.layers[-1].bias), network, small
        )
        return ChainC2S(
            Trunk.of(arm),
            hysteresis,
            Equilibrium.untrained(arm, len(self.creep_times)),
            jnp.eye(2 * modules),
            network,
            statics,
        )

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[ChainC2S]:
        """See `ForwardOptions`; on whole episodes from rest: the model has memory.

        Linear least squares with nonnegative weights fit the hysteresis first. Then the
        physics are trained alone, so that they extrapolate, and last all together.
        """
        network_key, fit_key = jax.random.split(key)
        model = self.untrained(data.arm, network_key)
        split = hysteresis_samples(model, data)
        if np.isfinite(split.training.targets).all():
            model = _with_fitted_hysteresis(model, split.training)
        ridge = ridge_of(split.training)
        physics = _ChainLoss(ridge, share=jnp.zeros(()))
        shorter = shortened(fit, FEW_EPOCHS)
        first = train(model, physics, predicted_targets, split, shorter, fit_key, quiet)
        model = first.network
        loss = _ChainLoss(ridge)
        return train(model, loss, predicted_targets, split, fit, fit_key, progress)

    def resume_training(  # type: ignore[override]
        self,
        model: ChainC2S,
        spread: ChainC2S,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[ChainC2S]:
        """See `ForwardOptions`: trains all parameters with a penalty on their change.

        Few samples do not determine all parameters. The penalty is that of a normal
        distribution with the spread of the prior.
        """
        penalty = _Penalty(PRIOR_PENALTY, parameters(model), parameters(spread))
        split = hysteresis_samples(model, data)
        loss = _ChainLoss(jnp.zeros(()), penalty=penalty)
        return train(model, loss, predicted_targets, split, fit, key, progress)

    def pretrain(
        self,
        arms: Sequence[TrainingData],
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained[ChainC2S]:
        """See `ForwardOptions`: a joint chain, then a chain of each arm from it.

        Raises:
            TrainingError: see `pooled`, or training failed.
        """
        together = pooled(arms)
        joint_fit = shortened(fit, JOINT_EPOCHS)
        arm_fit = shortened(fit, FEW_EPOCHS)
        epochs = joint_fit.max_epochs + len(arms) * arm_fit.max_epochs
        report = part_of(progress, 0, epochs)
        joint = self.train(together, joint_fit, key, report)
        penalty = _Penalty(ARM_PENALTY, parameters(joint.network), [])
        loss = _ChainLoss(jnp.zeros(()), penalty=penalty)
        chains = []
        for number, data in enumerate(arms, start=1):
            split = hysteresis_samples(joint.network, data)
            trained = train(
                joint.network, loss, predicted_targets, split, arm_fit, key, quiet
            )
            chains.append(trained.network)
            done = joint_fit.max_epochs + number * arm_fit.max_epochs
            progress(done, epochs, float(trained.curve[:, 2].min()))
        mean, spread = mean_and_spread(chains)
        samples = hysteresis_samples(mean, together)
        result = evaluated(mean, joint.curve, predicted_targets, samples)
        return replace(result, spread=spread)

    def predictions(self, model: ForwardModel, data: TrainingData) -> EpisodeStates:
        """See `ForwardOptions`; uses cable displacements where they were recorded."""
        return along_inputs(model, data, "states")


def along_inputs(model: Any, data: TrainingData, output: str) -> np.ndarray:
    """An output at every sample of all episodes, for inputs as in training."""
    inputs = hysteresis_inputs(getattr(model, "chain", model), data)
    return np.stack([_at_inputs(model, jnp.asarray(each), output) for each in inputs])


@eqx.filter_jit
def _at_inputs(model: Any, inputs: Array, output: str) -> Array:
    return getattr(model, output)(inputs)


class _Penalty(eqx.Module):
    """Penalty on the change of parameters: weight sum ((p - p_initial) / spread)^2.

    Attributes:
        weight: relative to the mean squared error of the states.
        initial: parameters before the training.
        spread: unit of each parameter's change; an empty list stands for units of one.
    """

    weight: float
    initial: list[Array]
    spread: list[Array]

    def __call__(self, model: ChainC2S) -> Scalar:
        changes = jax.tree.map(jnp.subtract, parameters(model), self.initial)
        if self.spread:
            changes = jax.tree.map(jnp.divide, changes, self.spread)
        squares = [jnp.sum(change**2) for change in changes]
        return self.weight * sum(squares, jnp.zeros(()))


class _ChainLoss(eqx.Module):
    """Mean squared error of states, with a penalty on the change of parameters.

    A module, so that trainings of equal shapes share a compiled program.

    Attributes:
        ridge: weight of the squared weights of the network.
        share: of the network's weights that counts: zero trains the physics alone.
        penalty: on the change of parameters; None for none.
        stiffness: logarithms that are not trained; None to train those of the model.
    """

    ridge: Scalar
    share: Scalar = eqx.field(default_factory=partial(jnp.ones, ()))
    penalty: _Penalty | None = None
    stiffness: PerModule | None = None

    def __call__(
        self, model: ChainC2S, batch: Batch, key: PRNGKeyArray | None
    ) -> Scalar:
        if self.stiffness is not None:
            equilibrium = replace(model.equilibrium, log_stiffness=self.stiffness)
            model = replace(model, equilibrium=equilibrium)
        weights, others = eqx.partition(model.network, eqx.is_inexact_array)
        weights = jax.tree.map(lambda weight: self.share * weight, weights)
        model = replace(model, network=eqx.combine(weights, others))
        error = known_error(predicted_targets(model, batch), batch["targets"])
        unit = LENGTH_UNIT * jnp.sum(model.body.lengths)
        positions = jnp.mean((error[..., :3] / unit) ** 2)
        mean = positions + AXIS_WEIGHT * jnp.mean(error[..., 3:] ** 2)
        if key is None:
            return mean
        squares = [jnp.sum(layer.weight**2) for layer in model.network.layers]
        mean += self.ridge * sum(squares)
        return mean if self.penalty is None else mean + self.penalty(model)


def train_further(
    model: ChainC2S,
    split: Split,
    ridge: Scalar,
    fit: FitOptions,
    key: PRNGKeyArray,
    progress: TrainingProgress = quiet,
) -> Trained[ChainC2S]:
    """Train a chain further, with another weight of its network's size.

    Its stiffness stays: samples without payload hardly determine it, it would drift,
    and predictions under a payload would err.
    """
    loss = _ChainLoss(ridge, stiffness=model.equilibrium.log_stiffness)
    return train(model, loss, predicted_targets, split, fit, key, progress)


def ridge_of(samples: Samples) -> Array:
    """`RIDGE` over the number of samples, as a prior of the weights counts."""
    return jnp.asarray(RIDGE / len(samples.targets))


def part_of(progress: TrainingProgress, begin: int, total: int) -> TrainingProgress:
    """Progress of a training that begins after some of all epochs."""

    def part(epoch: int, _: int, loss: float) -> None:
        progress(begin + epoch, total, loss)

    return part


def shortened(fit: FitOptions, share: float) -> FitOptions:
    """Training options with a share of the epochs."""
    epochs = max(1, round(share * fit.max_epochs))
    return replace(fit, max_epochs=epochs, patience=epochs)


def predicted_targets(model: Any, batch: Batch) -> Array:
    """Predicted states for inputs of the hysteresis."""
    return model.states(batch["configurations"])


def hysteresis_inputs(
    model: ChainC2S, data: TrainingData
) -> Float[np.ndarray, "episodes samples modules inputs cables"]:
    """Inputs of the hysteresis at every sample, with its memory along each episode."""
    displacements = data.displacements
    if displacements is None:
        sensed = jnp.asarray(data.sensed, dtype=jnp.float32)
        displacements = np.asarray(model.body.displacements(sensed))
    samples_first = jnp.asarray(np.moveaxis(displacements, 1, 0), dtype=jnp.float32)
    inputs = _inputs_along(model.hysteresis, samples_first)
    return np.moveaxis(np.asarray(inputs), 0, 1)


@eqx.filter_jit
def _inputs_along(
    hysteresis: Hysteresis,
    displacements: Float[Array, "samples episodes modules cables"],
) -> Float[Array, "samples episodes modules inputs cables"]:
    def step(memory, now):
        return hysteresis.advance(now, memory), hysteresis.inputs(now, memory)

    memory = hysteresis.start(displacements[0])
    return jax.lax.scan(step, memory, displacements)[1]


def hysteresis_samples(model: ChainC2S, data: TrainingData) -> Split:
    """`forward_samples` with inputs of the hysteresis in place of configurations."""
    return forward_samples(hysteresis_inputs(model, data), data.states, data.lengths)


def _with_fitted_hysteresis(model: ChainC2S, samples: Samples) -> ChainC2S:
    """Fit the weights of each module by linear least squares to its true bend.

    The bends of the other modules are further regressors. Weights of play operators are
    not negative, those of filters have one sign. With statics the weights sum up to one,
    since the stiffness then scales displacements to bends.
    """
    bends = np.asarray(bends_from_states(jnp.asarray(samples.targets)))
    inputs = np.einsum(
        "mkn,smjn->msjk",
        np.asarray(model.body.inverses),
        samples.inputs["configurations"],
    )
    _, plays, cables = model.hysteresis.play_weights.shape
    creep = plays + model.hysteresis.delays
    weights = np.array(
        [
            _fit_weights(inputs, bends[:, module], module, plays, creep)
            for module in range(len(inputs))
        ]
    )
    if model.statics:
        weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-3)
    positive = np.maximum(weights[:, :plays], np.log1p(np.exp(NO_WEIGHT)))

    def for_all_cables(weights: np.ndarray) -> Array:
        repeated = np.repeat(weights[..., None], cables, axis=-1)
        return jnp.asarray(repeated, dtype=jnp.float32)

    hysteresis = replace(
        model.hysteresis,
        play_weights=for_all_cables(positive + np.log(-np.expm1(-positive))),
        delay_weights=for_all_cables(weights[:, plays:creep]),
        creep=Viscoelasticity.from_weights(for_all_cables(weights[:, creep:])),
    )
    return replace(model, hysteresis=hysteresis)


def _fit_weights(
    inputs: np.ndarray, bends: np.ndarray, module: int, plays: int, creep: int
) -> np.ndarray:
    """Weights of one module's inputs: plays, then delays, then creep of one sign."""
    from scipy.optimize import lsq_linear  # noqa: PLC0415  # heavy

    own = np.moveaxis(inputs[module], 1, -1)  # (samples, 2, inputs)
    others = np.moveaxis(np.delete(inputs[:, :, 0], module, axis=0), 0, -1)
    columns = np.concatenate([own, others], axis=-1).reshape(2 * len(own), -1)
    count = own.shape[-1]
    targets = bends.reshape(-1).astype(float)
    low = np.full(columns.shape[1], -np.inf)
    low[:plays] = 0.0
    low[plays:creep] = -MAX_CREEP
    fits = []
    for sign in (-1.0, 1.0):
        high = np.full(columns.shape[1], np.inf)
        low[creep:count] = min(sign, 0.0) * MAX_CREEP
        high[creep:count] = max(sign, 0.0) * MAX_CREEP
        fits.append(lsq_linear(columns.astype(float), targets, (low, high)))
    return min(fits, key=lambda fit: fit.cost).x[:count]
