"""Training the forward model of the `best` recipe."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import Samples, Split
from s2c2a.data.windows import stretches
from s2c2a.kinematics import bends_from_configurations, configurations_from_states
from s2c2a.networks import ChainC2S, ChainSize
from s2c2a.networks.chain_c2s import NO_WEIGHT
from s2c2a.training.fit import FitOptions, Progress, fit
from s2c2a.training.networks import Trained, batch_of, evaluated

LENGTH_UNIT = 0.4  # of the arm's length: an error of one in position
AXIS_WEIGHT = 0.3  # of squared errors of axes beside those of positions
MOST_CREEP = 0.5  # of a filter's weight before training


def train_chain_c2s(
    sensed: Float[np.ndarray, "episodes samples modules 3"],
    states: Float[np.ndarray, "episodes samples modules 6"],
    arm: ArmSpec,
    size: ChainSize,
    options: FitOptions,
    key: PRNGKeyArray,
    progress: Progress = lambda *_: None,
) -> Trained[ChainC2S]:
    """Train on whole episodes, each from rest, since the model remembers.

    Hysteresis is first fitted by linear least squares with weights that are not negative, then everything together.

    Args:
        sensed: sensed configurations.
        states: true states of the same moments.
        arm: the arm.
        size: what the model is made of.
        options: how to train.
        key: for weights and order.
        progress: told epoch, most epochs, validation loss.

    Raises:
        TrainingError: too few samples, or the loss is not finite.
    """
    network_key, fit_key = jax.random.split(key)
    model = ChainC2S.untrained(arm, size, network_key)
    split = _samples(model, sensed, states)
    model = _with_fitted_hysteresis(model, split.training)
    unit = LENGTH_UNIT * arm.length

    def loss(model: ChainC2S, batch: dict[str, Array], key) -> Array:
        error = model.states(batch["inputs"]) - batch["targets"]
        return jnp.mean((error[..., :3] / unit) ** 2) + AXIS_WEIGHT * jnp.mean(error[..., 3:] ** 2)

    result = fit(model, loss, batch_of(split.training), batch_of(split.validation), options, fit_key, progress)
    return evaluated(result, lambda model, batch: model.states(batch["inputs"]), split)


def _samples(model: ChainC2S, sensed: np.ndarray, states: np.ndarray) -> Split:
    """What the hysteresis weighs at every moment of every episode, its memory carried along."""

    @jax.jit
    def along(configurations: Float[Array, "samples episodes modules 3"]) -> Array:
        def step(memory, now):
            return model.observe(now, memory), model.hysteresis.inputs(model.body.displacements(now), memory)

        return jax.lax.scan(step, model.start(configurations[0]), configurations)[1]

    inputs = np.moveaxis(np.asarray(along(jnp.asarray(np.moveaxis(sensed, 1, 0), dtype=jnp.float32))), 0, 1)
    parts = stretches(sensed.shape[1])
    return Split(*(Samples({"inputs": _merge(inputs[:, part])}, _merge(states[:, part])) for part in parts))


def _with_fitted_hysteresis(model: ChainC2S, samples: Samples) -> ChainC2S:
    """Weights with which each module's inputs, and the other modules' bends, best tell its true bend.

    Only what moves with the motor or stays may weigh in plays; filters may weigh either way. With statics the weights
    sum up to one, since there the stiffness says how much of a displacement becomes a bend.
    """
    true = np.asarray(bends_from_configurations(configurations_from_states(jnp.asarray(samples.targets))))
    inputs = np.einsum("mkn,smjn->msjk", np.asarray(model.body.inverses), samples.inputs["inputs"])
    plays = model.hysteresis.play_weights.shape[1]
    fitted = np.array([_fitted(inputs, true, module, plays) for module in range(len(inputs))])
    if model.statics:
        fitted /= np.maximum(fitted.sum(axis=1, keepdims=True), 1e-3)
    positive = np.maximum(fitted[:, :plays], np.log1p(np.exp(NO_WEIGHT)))
    raw = jnp.asarray(np.log(np.expm1(positive)), dtype=jnp.float32)
    creep = jnp.asarray(fitted[:, plays:], dtype=jnp.float32)
    return eqx.tree_at(lambda m: (m.hysteresis.play_weights, m.hysteresis.creep_weights), model, (raw, creep))


def _fitted(inputs: np.ndarray, true: np.ndarray, module: int, plays: int) -> np.ndarray:
    """Weights of one module's inputs."""
    from scipy.optimize import lsq_linear  # noqa: PLC0415 (a third of a second that few starts need)

    own = np.moveaxis(inputs[module], 1, -1)  # (samples, 2, inputs)
    others = [inputs[other, :, 0] for other in range(len(inputs)) if other != module]
    columns = np.concatenate([own, *(bend[..., None] for bend in others)], axis=-1).reshape(2 * len(own), -1)
    count = own.shape[-1]
    low = np.full(columns.shape[1], -np.inf)
    low[:plays], low[plays:count] = 0.0, -MOST_CREEP
    return lsq_linear(columns.astype(float), true[:, module].reshape(-1).astype(float), (low, np.inf)).x[:count]


def _merge(values: np.ndarray) -> np.ndarray:
    return values.reshape(-1, *values.shape[2:]).astype(np.float32)
