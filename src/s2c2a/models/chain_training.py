"""Options and training of the chain: hysteresis by least squares, then everything."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions
from s2c2a.data.windows import Samples, Split, forward_samples
from s2c2a.errors import TrainingError
from s2c2a.kinematics import bends_from_states
from s2c2a.models.c2s import ForwardOptions
from s2c2a.models.cables import Hysteresis, Operators
from s2c2a.models.chain import OUTPUTS, ChainC2S
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.statics import Equilibrium
from s2c2a.models.transfer import babbled, carried_over, under_weights
from s2c2a.models.trunk import Trunk
from s2c2a.training.fit import Batch, FitOptions, Progress, check_limits, quiet
from s2c2a.training.trained import Trained, TrainingData, known_error, train

NO_WEIGHT = -7.0  # before a softplus
LENGTH_UNIT = 0.4  # of the arm's length; scale of position errors
AXIS_WEIGHT = 0.3  # of squared axis errors, relative to positions
DELAY = 0.1  # s; time constant of the filter that stands for delay
MAX_CREEP = 0.5  # of a filter's weight before training
PULL = 3e-3
"""Penalty of squared changes from the start, when training continues from another arm."""
REHEARSED = FitOptions(
    learning_rate=2e-3, max_epochs=20, patience=20, epochs_per_call=10, decay=True
)
"""Training of a new network on the effect of weights."""


@dataclass(frozen=True)
class ChainOptions(ForwardOptions):
    """Options of the chain model.

    Attributes:
        hidden: units of each hidden layer of its network.
        depth: number of hidden layers.
        play_widths: half-widths of the play operators, in parts of the cable radius
            [rad]; empty for no backlash.
        creep_times: time constants of filters [s].
        statics: whether to model that cables only pull and stretch, if the sensors are
            encoders.
    """

    hidden: int = 64
    depth: int = 2
    play_widths: tuple[float, ...] = (
        0.002,
        0.005,
        0.011,
        0.019,
        0.026,
        0.033,
        0.041,
        0.052,
        0.067,
    )
    creep_times: tuple[float, ...] = (1.0, 3.0, 10.0, 30.0)
    statics: bool = True
    model: str = field(default="chain", kw_only=True)

    def __post_init__(self):
        """Refuse impossible numbers."""
        check_limits(
            self,
            hidden=(1, 4096),
            depth=(1, 32),
            play_widths=(1e-6, 10),
            creep_times=(1e-6, 1e6),
        )

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ChainC2S:
        """See `ForwardOptions`: no hysteresis, and a network with outputs near zero."""
        modules = arm.module_count
        # at longer control periods, the last reading stands for the delay
        delays = (DELAY,) if arm.control_period < DELAY else ()
        taken = [
            1.0 - np.exp(-arm.control_period / time)
            for time in (*delays, *self.creep_times)
        ]
        widths, shares = (
            jnp.asarray(part, dtype=jnp.float32).reshape(-1)
            for part in (self.play_widths, taken)
        )
        shape = modules, len(self.play_widths) + 2, arm.cable_count
        play_weights = jnp.full(shape, NO_WEIGHT).at[:, 0].set(np.log(np.expm1(1.0)))
        statics = bool(self.statics) and _is_felt_through_cables(arm)
        creep_weights = jnp.zeros((modules, len(shares), shape[-1]))
        hysteresis = Hysteresis(
            Operators(widths, shares), play_weights, creep_weights, len(delays)
        )
        network = self._quiet_network(
            modules * (2 + arm.cable_count if statics else 2), OUTPUTS * modules, key
        )
        equilibrium = Equilibrium.untrained(modules, len(shares))
        return ChainC2S(
            Trunk.of(arm),
            hysteresis,
            equilibrium,
            jnp.eye(2 * modules),
            network,
            statics,
        )

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[ChainC2S]:
        """See `ForwardOptions`; on whole episodes, each from rest, since the model remembers.

        Hysteresis is first fitted by linear least squares with weights that are not
        negative, then everything together.
        """
        network_key, fit_key = jax.random.split(key)
        model = self.untrained(data.arm, network_key)
        samples = samples_along(model, data).training
        if np.isfinite(samples.targets).all():
            model = _with_fitted_hysteresis(model, samples)
        return _trained(model, data, lambda model: model, fit, fit_key, progress)

    def go_on(  # type: ignore[override]
        self,
        model: ChainC2S,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[ChainC2S]:
        """See `ForwardOptions`: everything together, pulled towards where it began: few samples tell little of it."""
        return _trained(model, data, lambda model: model, fit, key, progress, PULL)

    def carried(  # type: ignore[override]
        self,
        model: ChainC2S,
        old: ArmSpec,
        new: ArmSpec,
        babbling: CollectOptions,
        key: PRNGKeyArray,
    ) -> ChainC2S:
        """See `ForwardOptions`: module by module; of another count the network learns anew, what weights do."""
        chain = carried_over(model, old, ChainOptions.untrained(self, new, key), new)
        if old.module_count == new.module_count:
            return chain
        if not chain.statics:
            raise TrainingError(
                f"networks of {old.module_count} modules were given for '{new.name}' of {new.module_count}; other "
                "counts carry over where encoders tell of cables that motors move; collect, and train without --from"
            )
        data = babbled(new, babbling)
        part = attrgetter("network")
        states = [
            np.asarray(under_weights(chain, jnp.asarray(one)))
            for one in inputs_along(chain, data)
        ]
        weighed = replace(data, states=np.stack(states))
        return _trained(
            chain,
            weighed,
            lambda m: eqx.tree_at(part, chain, m.network),
            REHEARSED,
            key,
            quiet,
        ).network

    def answers(
        self, model: ForwardModel, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules 6"]:
        """See `ForwardOptions`; where cables moved together, that counts too."""
        chain: Any = getattr(model, "chain", model)
        return np.stack(
            [
                np.asarray(predict_states(model, jnp.asarray(one)))
                for one in inputs_along(chain, data)
            ]
        )

    def _quiet_network(
        self, features: int, outputs: int, key: PRNGKeyArray
    ) -> eqx.nn.MLP:
        network = eqx.nn.MLP(
            features, outputs, self.hidden, self.depth, jax.nn.tanh, key=key
        )
        head = network.layers[-1]
        quiet = (0.01 * head.weight, jnp.zeros(head.weight.shape[0]))
        return eqx.tree_at(
            lambda net: (net.layers[-1].weight, net.layers[-1].bias), network, quiet
        )


def _trained(
    model: ChainC2S,
    data: TrainingData,
    seen: Callable[[ChainC2S], ChainC2S],
    fit: FitOptions,
    key: PRNGKeyArray,
    progress: Progress,
    pull: float = 0.0,
) -> Trained[ChainC2S]:
    """Trained to say true states, as far as what is seen of it can, and not to go far from where it began."""
    unit = LENGTH_UNIT * data.arm.length
    begun = eqx.filter(model, eqx.is_inexact_array)

    def far(model: ChainC2S) -> Array:
        moved = jax.tree.map(
            jnp.subtract, eqx.filter(model, eqx.is_inexact_array), begun
        )
        return sum((jnp.sum(part**2) for part in jax.tree.leaves(moved)), jnp.zeros(()))

    def loss(model: ChainC2S, batch: Batch, key: PRNGKeyArray | None) -> Array:
        error = known_error(answer(seen(model), batch), batch["targets"])
        missed = jnp.mean((error[..., :3] / unit) ** 2) + AXIS_WEIGHT * jnp.mean(
            error[..., 3:] ** 2
        )
        return missed if key is None or not pull else missed + pull * far(model)

    return train(model, loss, answer, samples_along(model, data), fit, key, progress)


def _is_felt_through_cables(arm: ArmSpec) -> bool:
    """Whether sensed configurations are displacements of pulling cables, module by module."""
    return (
        arm.actuation == "displacement"
        and arm.sensing == "encoders"
        and arm.sensing_coupling is None
    )


@eqx.filter_jit
def predict_states(model: Any, inputs: Array) -> Array:
    """States for inputs of the hysteresis model, compiled."""
    return model.states(inputs)


def answer(model: Any, batch: Batch) -> Array:
    """States for inputs that the hysteresis weighs."""
    return model.states(batch["configurations"])


def inputs_along(
    model: ChainC2S, data: TrainingData
) -> Float[np.ndarray, "episodes samples modules inputs cables"]:
    """What the hysteresis weighs at every sample, its memory carried along each episode."""

    @jax.jit
    def along(displacements: Float[Array, "samples episodes modules cables"]) -> Array:
        def step(memory, now):
            return model.hysteresis.advance(now, memory), model.hysteresis.inputs(
                now, memory
            )

        return jax.lax.scan(
            step, model.hysteresis.start(displacements[0]), displacements
        )[1]

    moved = data.displacements
    if moved is None:
        moved = np.asarray(
            model.body.displacements(jnp.asarray(data.sensed, dtype=jnp.float32))
        )
    return np.moveaxis(
        np.asarray(along(jnp.asarray(np.moveaxis(moved, 1, 0), dtype=jnp.float32))),
        0,
        1,
    )


def samples_along(model: ChainC2S, data: TrainingData) -> Split:
    """`forward_samples` with what the hysteresis weighs in place of configurations."""
    return forward_samples(inputs_along(model, data), data.states, data.lengths)


def _with_fitted_hysteresis(model: ChainC2S, samples: Samples) -> ChainC2S:
    """Weights with which each module's inputs, and the other modules' bends, best tell its true bend.

    Only what moves with the motor or stays may weigh in plays; filters may weigh either
    way. With statics the weights sum up to one, since there the stiffness says how much
    of a displacement becomes a bend.
    """
    true = np.asarray(bends_from_states(jnp.asarray(samples.targets)))
    inputs = np.einsum(
        "mkn,smjn->msjk",
        np.asarray(model.body.inverses),
        samples.inputs["configurations"],
    )
    plays = model.hysteresis.play_weights.shape[1]
    fitted = np.array(
        [_fitted(inputs, true, module, plays) for module in range(len(inputs))]
    )
    if model.statics:
        fitted /= np.maximum(fitted.sum(axis=1, keepdims=True), 1e-3)
    positive = np.maximum(fitted[:, :plays], np.log1p(np.exp(NO_WEIGHT)))
    cables = model.hysteresis.play_weights.shape[-1]
    alike = [
        np.repeat(part[..., None], cables, axis=-1)
        for part in (np.log(np.expm1(positive)), fitted[:, plays:])
    ]
    raw, creep = (jnp.asarray(part, dtype=jnp.float32) for part in alike)
    return eqx.tree_at(
        lambda m: (m.hysteresis.play_weights, m.hysteresis.creep_weights),
        model,
        (raw, creep),
    )


def _fitted(
    inputs: np.ndarray, true: np.ndarray, module: int, plays: int
) -> np.ndarray:
    """Weights of one module's inputs."""
    from scipy.optimize import lsq_linear  # noqa: PLC0415  # heavy

    own = np.moveaxis(inputs[module], 1, -1)  # (samples, 2, inputs)
    others = [inputs[other, :, 0] for other in range(len(inputs)) if other != module]
    columns = np.concatenate(
        [own, *(bend[..., None] for bend in others)], axis=-1
    ).reshape(2 * len(own), -1)
    count = own.shape[-1]
    low = np.full(columns.shape[1], -np.inf)
    low[:plays] = 0.0
    low[plays:count] = -MAX_CREEP
    return lsq_linear(
        columns.astype(float), true[:, module].reshape(-1).astype(float), (low, np.inf)
    ).x[:count]
