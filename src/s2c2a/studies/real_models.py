"""What forward models are compared with on real recordings: regression without structure, and arcs without data."""

from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.windows import forward_samples
from s2c2a.kinematics import ForwardModel, bends_from_configurations
from s2c2a.kinematics.chain import states_from_arcs
from s2c2a.models import ForwardOptions
from s2c2a.models.cables import Hysteresis, Operators
from s2c2a.models.layers import LSTM
from s2c2a.models.trunk import Trunk
from s2c2a.training import FitOptions, Progress, Trained, TrainingData, quiet, train
from s2c2a.training.trained import as_batch, known_error

PLAYS = (0.02, 0.04, 0.08, 0.16)  # half-widths in parts of the largest displacement
WIDTHS = (0.5, 1.0, 2.0, 4.0)
RIDGES = (1e-4, 1e-3, 1e-2)


def moved_along(
    data: TrainingData,
) -> Float[np.ndarray, "episodes samples modules cables"]:
    """Displacements of the cables over their radius [rad], as driven or as sensed bends say."""
    if data.displacements is not None:
        return data.displacements
    return np.asarray(
        Trunk.of(data.arm).displacements(jnp.asarray(data.sensed, jnp.float32))
    )


class _Regression(ForwardOptions):
    """A model of what cables do, compared and never planned with."""

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> ForwardModel:
        """Nothing keeps one in a file."""
        raise NotImplementedError(f"{type(self).__name__} is for comparisons alone")


@dataclass(frozen=True)
class KernelRegression(_Regression):
    """Ridge regression with one Gaussian kernel, its width and ridge chosen on samples held out.

    Attributes:
        plays: whether it sees what plays of four widths remember.
    """

    plays: bool = True
    model: str = field(default="kernel regression", kw_only=True)

    def answers(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules 6"]:
        """See `ForwardOptions`."""
        inputs = self._inputs(data)
        return model(inputs.reshape(-1, inputs.shape[-1])).reshape(
            *inputs.shape[:2], -1, 6
        )

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained:
        """See `ForwardOptions`."""
        split = forward_samples(self._inputs(data), data.states, data.lengths)
        parts = split.training, split.validation, split.test
        x, y = zip(
            *(
                (
                    part.inputs["configurations"],
                    part.targets.reshape(len(part.targets), -1),
                )
                for part in parts
            ),
            strict=True,
        )
        tries = [(width, ridge) for width in WIDTHS for ridge in RIDGES]
        best = min(
            tries,
            key=lambda one: float(
                np.nanmean((_ridge(x[0], y[0], *one)(x[1]) - y[1]) ** 2)
            ),
        )
        return Trained(
            _ridge(np.concatenate(x), np.concatenate(y), *best),
            np.zeros((0, 3)),
            (np.nan, np.nan),
        )

    def _inputs(self, data: TrainingData) -> np.ndarray:
        moved = moved_along(data)
        if self.plays:
            moved = _with_plays(moved, np.abs(moved).max())
        return moved.reshape(*moved.shape[:2], -1)


def _with_plays(moved: np.ndarray, full: float) -> np.ndarray:
    widths = jnp.asarray(PLAYS) * full
    shape = moved.shape[2], len(PLAYS) + 2, moved.shape[3]
    play = Hysteresis(
        Operators(widths, jnp.zeros(0)),
        jnp.zeros(shape),
        jnp.zeros((shape[0], 0, shape[2])),
    )

    @jax.jit
    def along(rows):
        def step(memory, now):
            after = play.advance(now, memory)
            return after, jnp.concatenate([now[..., None, :], after.plays], axis=-2)

        return jax.lax.scan(step, play.start(rows[0]), rows)[1]

    return np.stack([along(jnp.asarray(one, jnp.float32)) for one in moved])


def _ridge(x: np.ndarray, y: np.ndarray, width: float, ridge: float) -> Any:
    """A function of inputs; outputs that were never known stay so."""
    whole = np.isfinite(y[:, np.isfinite(y).any(axis=0)]).all(axis=1)
    x = x[whole]
    y = y[whole]
    center = x.mean(axis=0)
    scale = np.maximum(x.std(axis=0), 1e-6)
    mean = y.mean(axis=0)
    points = (x - center) / scale
    length = width * np.sqrt(x.shape[1])

    def near(values: np.ndarray) -> np.ndarray:
        squared = (
            (values**2).sum(1)[:, None] + (points**2).sum(1) - 2.0 * values @ points.T
        )
        return np.exp(-squared / (2.0 * length**2))

    weights = np.linalg.solve(near(points) + ridge * np.eye(len(points)), y - mean)
    return lambda values: near((values - center) / scale) @ weights + mean


@dataclass(frozen=True)
class Recurrent(_Regression):
    """An LSTM over the last readings.

    Attributes:
        steps: how many readings it sees.
        hidden: units of each of two layers.
    """

    steps: int = 10
    hidden: int = 64
    model: str = field(default="recurrent network", kw_only=True)

    def answers(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules 6"]:
        """See `ForwardOptions`."""
        windows = self._windows(data)
        return np.stack(
            [np.asarray(jax.jit(model)(jnp.asarray(one))) for one in windows]
        ).reshape(data.states.shape)

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained:
        """See `ForwardOptions`."""
        split, one, two = (
            forward_samples(self._windows(data), data.states, data.lengths),
            *jax.random.split(key),
        )
        scale = data.arm.length
        network = LSTM(
            self._windows(data).shape[-1], data.states[0, 0].size, 2, self.hidden, one
        )
        answer = lambda net, batch: net(batch["configurations"]).reshape(
            batch["targets"].shape
        )

        def loss(net: LSTM, batch: dict, key: PRNGKeyArray | None) -> Array:
            return jnp.mean(
                (known_error(answer(net, batch), batch["targets"]) / scale) ** 2
            )

        return train(network, loss, answer, split, fit, two, progress)

    def _windows(self, data: TrainingData) -> np.ndarray:
        """Oldest reading first; before an episode it stood as it began."""
        moved = moved_along(data)
        flat = moved.reshape(*moved.shape[:2], -1)
        late = [
            np.concatenate(
                [np.repeat(flat[:, :1], age, axis=1), flat[:, : flat.shape[1] - age]],
                axis=1,
            )
            for age in range(self.steps - 1, -1, -1)
        ]
        return np.stack(late, axis=2).astype(np.float32)


@dataclass(frozen=True)
class FittedArcs(_Regression):
    """Constant curvature with one gain a module, as `pcc-fitted`, and lengths; what the ends seen say best."""

    model: str = field(default="fitted PCC", kw_only=True)

    def answers(
        self, model: Any, data: TrainingData
    ) -> Float[np.ndarray, "episodes samples modules 6"]:
        """See `ForwardOptions`."""
        return np.asarray(_arcs(jnp.asarray(model, jnp.float32), self._bends(data)))

    def train(
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained:
        """See `ForwardOptions`; least squares over all that is known."""
        from scipy.optimize import least_squares

        split = forward_samples(self._bends(data), data.states, data.lengths)
        batches = [
            as_batch(part) for part in (split.training, split.validation, split.test)
        ]
        lengths = ArmGeometry.of(data.arm).lengths

        def misses(numbers: np.ndarray) -> np.ndarray:
            parts = (
                known_error(
                    _arcs(jnp.asarray(numbers, jnp.float32), one["configurations"]),
                    one["targets"],
                )
                for one in batches
            )
            return np.concatenate(
                [np.asarray(part)[..., :3].reshape(-1) for part in parts]
            ).astype(float)

        found = least_squares(
            misses,
            np.concatenate([np.ones_like(lengths), lengths]),
            diff_step=1e-3,
            max_nfev=30,
        )
        return Trained(found.x, np.zeros((0, 3)), (np.nan, np.nan))

    def _bends(self, data: TrainingData) -> np.ndarray:
        return np.asarray(
            bends_from_configurations(jnp.asarray(data.sensed, jnp.float32))
        )


@jax.jit
def _arcs(numbers: Array, bends: Array) -> Array:
    modules = bends.shape[-2]
    return states_from_arcs(
        bends * numbers[:modules, None], numbers[modules:], jnp.zeros((modules, 3))
    )
