"""Reference models for real recordings: kernel regression, fitted PCC."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.windows import EpisodeActions, EpisodeStates, forward_samples
from s2c2a.kinematics import bends_from_configurations
from s2c2a.kinematics.chain import states_from_arcs
from s2c2a.models import ForwardOptions
from s2c2a.models.cables import Hysteresis, Operators, Viscoelasticity
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.trunk import Trunk
from s2c2a.spaces import POSITION
from s2c2a.training import (
    FitOptions,
    Trained,
    TrainingData,
    TrainingProgress,
    quiet,
)
from s2c2a.training.trained import as_batch, known_error

PLAY_WIDTHS = (0.02, 0.04, 0.08, 0.16)  # fractions of the largest displacement
KERNEL_WIDTHS = (0.5, 1.0, 2.0, 4.0)
RIDGES = (1e-4, 1e-3, 1e-2)


def cable_displacements(
    data: TrainingData,
) -> EpisodeActions:
    """Displacements of the cables over their radius [rad], as commanded or sensed."""
    if data.displacements is not None:
        return data.displacements
    sensed = jnp.asarray(data.sensed, jnp.float32)
    return np.asarray(Trunk.of(data.arm).displacements(sensed))


def without_curves(model: Any) -> Trained:
    """A model that was not trained by epochs."""
    return Trained(model, np.zeros((0, 3)), (np.nan, np.nan))


class ReferenceModel(ForwardOptions):
    """A model for comparisons; it is neither saved nor used for planning."""

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ForwardModel:
        """See `ForwardOptions`; raises, because no file holds such a model."""
        raise NotImplementedError(f"{type(self).__name__} is for comparisons only")

    def deviations(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules"]:
        """See `ForwardOptions`; unknown."""
        return np.zeros(data.states.shape[:3])


class Regression(NamedTuple):
    """A function of inputs.

    Attributes:
        predict: from inputs to targets.
        deviations: root mean squared distances of the module ends on validation
            samples before the last fit, which uses these samples too [m]; zero if
            unknown.
    """

    predict: Callable[[np.ndarray], np.ndarray]
    deviations: Float[np.ndarray, " modules"]


@dataclass(frozen=True)
class KernelRegression(ReferenceModel):
    """Ridge regression with a Gaussian kernel; validation chooses its width and ridge."""

    model: str = field(default="kernel regression", kw_only=True)

    def predictions(self, model: Any, data: TrainingData) -> EpisodeStates:
        inputs = inputs_with_plays(data)
        states = model.predict(inputs.reshape(-1, inputs.shape[-1]))
        return states.reshape(*inputs.shape[:2], -1, 6)

    def deviations(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules"]:
        """See `ForwardOptions`; constant."""
        return np.broadcast_to(model.deviations, data.states.shape[:3])

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained:
        split = forward_samples(inputs_with_plays(data), data.states, data.lengths)
        inputs = []
        targets = []
        for part in (split.training, split.validation, split.test):
            inputs.append(part.inputs["configurations"])
            targets.append(part.targets.reshape(len(part.targets), -1))
        best = (np.inf, 0.0, 0.0)
        for width in KERNEL_WIDTHS:
            for ridge in RIDGES:
                predict = _ridge_regression(inputs[0], targets[0], width, ridge)
                missed = predict(inputs[1]) - targets[1]
                error = float(np.nanmean(missed**2))
                best = min(best, (error, width, ridge), key=lambda trial: trial[0])
        validated = _ridge_regression(inputs[0], targets[0], *best[1:])
        errors = validated(inputs[1]).reshape(split.validation.targets.shape)
        errors -= split.validation.targets
        squares = np.sum(errors[..., POSITION] ** 2, axis=-1)
        known = np.isfinite(squares)
        sums = squares.sum(axis=0, where=known)
        all_inputs = np.concatenate(inputs)
        all_targets = np.concatenate(targets)
        predict = _ridge_regression(all_inputs, all_targets, *best[1:])
        deviations = np.sqrt(sums / np.maximum(known.sum(axis=0), 1))
        return without_curves(Regression(predict, deviations))


def inputs_with_plays(
    data: TrainingData,
) -> Float[np.ndarray, "episodes samples inputs"]:
    """Displacements over their radius, and the states of their play operators [rad]."""
    displacements = _with_plays(cable_displacements(data))
    return displacements.reshape(*displacements.shape[:2], -1)


def _with_plays(displacements: np.ndarray) -> np.ndarray:
    """Displacements and the states of their play operators, along each episode."""
    modules, cables = displacements.shape[2:]
    widths = jnp.asarray(PLAY_WIDTHS) * np.abs(displacements).max()
    operators = Hysteresis(
        Operators(widths, jnp.zeros(0)),
        jnp.zeros((modules, len(PLAY_WIDTHS) + 2, cables)),
        jnp.zeros((modules, 0, cables)),
        Viscoelasticity.none(modules, 0, cables),
    )

    def step(memory, row):
        memory = operators.advance(row, memory)
        return memory, jnp.concatenate([row[..., None, :], memory.plays], axis=-2)

    @jax.jit
    def scan(episode):
        return jax.lax.scan(step, operators.start(episode[0]), episode)[1]

    return np.stack([scan(jnp.asarray(each, jnp.float32)) for each in displacements])


def _ridge_regression(
    inputs: np.ndarray, targets: np.ndarray, width: float, ridge: float
) -> Callable[[np.ndarray], np.ndarray]:
    """A function from inputs to targets; NaN for targets that are never known."""
    ever_known = np.isfinite(targets).any(axis=0)
    complete = np.isfinite(targets[:, ever_known]).all(axis=1)
    inputs = inputs[complete]
    targets = targets[complete]
    center = inputs.mean(axis=0)
    scale = np.maximum(inputs.std(axis=0), 1e-6)
    mean = targets.mean(axis=0)
    points = (inputs - center) / scale
    length = width * np.sqrt(inputs.shape[1])

    def kernel(values: np.ndarray) -> np.ndarray:
        own = (values**2).sum(1)[:, None]
        squares = own + (points**2).sum(1)
        distances = squares - 2.0 * values @ points.T
        return np.exp(-distances / (2.0 * length**2))

    regularized = kernel(points) + ridge * np.eye(len(points))
    weights = np.linalg.solve(regularized, targets - mean)
    return lambda values: kernel((values - center) / scale) @ weights + mean


@dataclass(frozen=True)
class FittedArcs(ReferenceModel):
    """Constant curvature with a gain and a length for each module, fitted to states."""

    model: str = field(default="fitted PCC", kw_only=True)

    def predictions(self, model: Any, data: TrainingData) -> EpisodeStates:
        return np.asarray(_arcs(jnp.asarray(model, jnp.float32), self._bends(data)))

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: TrainingProgress = quiet,
    ) -> Trained:
        """See `ForwardOptions`; least squares over all known positions."""
        from scipy.optimize import least_squares  # noqa: PLC0415  # heavy

        split = forward_samples(self._bends(data), data.states, data.lengths)
        parts = (split.training, split.validation, split.test)
        batches = [as_batch(part) for part in parts]
        lengths = ArmGeometry.of(data.arm).lengths

        def residuals(parameters: np.ndarray) -> np.ndarray:
            values = []
            for batch in batches:
                states = _arcs(
                    jnp.asarray(parameters, jnp.float32), batch["configurations"]
                )
                errors = known_error(states, batch["targets"])
                values.append(np.asarray(errors)[..., :3].reshape(-1))
            return np.concatenate(values).astype(float)

        start = np.concatenate([np.ones_like(lengths), lengths])
        result = least_squares(residuals, start, diff_step=1e-3, max_nfev=30)
        return without_curves(result.x)

    def _bends(self, data: TrainingData) -> np.ndarray:
        sensed = jnp.asarray(data.sensed, jnp.float32)
        return np.asarray(bends_from_configurations(sensed))


@jax.jit
def _arcs(parameters: Array, bends: Array) -> Array:
    """States of arcs; parameters are the gains, then the lengths of the modules."""
    modules = bends.shape[-2]
    gains = parameters[:modules, None]
    lengths = parameters[modules:]
    return states_from_arcs(bends * gains, lengths, jnp.zeros((modules, 3)))
