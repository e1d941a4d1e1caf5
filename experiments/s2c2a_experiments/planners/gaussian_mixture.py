"""Gaussian mixture regression: the inverse model is a density of what was recorded.

The source is [16HW] of the paper's Table I, after Ghahramani and Jordan (Advances in
Neural Information Processing Systems 6, 1993). A mixture of Gaussians is fitted by
expectation-maximization to positions of the tip, its axes and bends by the encoders, all
together. The next bends are its mean given the targets, without any optimization; the
last bends count as a noisy measurement of those wanted, which chooses one of the many
shapes that reach a target. Nothing but the encoders is read.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.goals import Goal
from s2c2a.integrations.extras import needs_extra
from s2c2a.kinematics import PCC
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import AXIS, POSITION
from s2c2a.strategies import Recipe, RunOptions, StrategyOptions, TrainedNetworks
from s2c2a.strategies.options import NetworkProgress
from s2c2a.training import Trained
from s2c2a.training.fit import Fixed
from s2c2a_experiments.planners.arc_driver import ArcDriver, Bends, Moment

MIXTURE = "mixture"  # as weight files have it
SAMPLES_EACH = 10  # a component at least; fewer have no covariance
MOST_SAMPLES = 20_000  # that the fit uses: a few seconds
TARGET_NOISE = 0.01  # arm lengths, and of an axis; below what the mixture resolves
LEAST_VARIANCE = 1e-5  # added by the fit; a planar arm has directions without any


class Mixture(Fixed):
    """Gaussians over tip position [arm lengths], axis and bends [rad].

    Attributes:
        weights: of the components, shape (components,).
        means: shape (components, 6 + 2 modules).
        covariances: shape (components, 6 + 2 modules, 6 + 2 modules).
    """

    weights: Float[Any, " components"]
    means: Float[Any, "components size"]
    covariances: Float[Any, "components size size"]


@dataclass(frozen=True)
class GaussianMixture(StrategyOptions):
    """Regression in a Gaussian mixture of tip, axis and bends.

    Attributes:
        components: of the mixture.
        bend_noise: of the last bends as a measurement of the wanted ones [rad].
        share: of the way to the regressed bends that a step goes.
    """

    components: int = 30
    bend_noise: float = 0.3
    share: float = 0.5
    name = "gmr"
    recipe_keys: ClassVar[frozenset[str]] = frozenset(
        {"babbling", "speeds", "episodes"}
    )
    ignores = frozenset({"other ends", "obstacles"})
    limits: ClassVar[Ranges] = {
        "components": (1, 1000),
        "bend_noise": (1e-3, 100.0),
        "share": (0.0, 1.0),
    }

    def collect_options(self, recipe: Recipe, seed: int) -> CollectOptions:
        return recipe.collect_options(seed)

    def training_key(self, recipe: Recipe) -> Any:
        """See `StrategyOptions`: the recipe matters to the recording alone."""
        return self.name, self.components

    def untrained(
        self, arm: ArmSpec, recipe: Recipe, key: PRNGKeyArray
    ) -> dict[str, Any]:
        count = self.components
        size = 6 + 2 * arm.module_count
        weights = jnp.full(count, 1.0 / count)
        means = jnp.zeros((count, size))
        covariances = jnp.tile(jnp.eye(size), (count, 1, 1))
        mixture = Mixture(weights, means, covariances)
        return {MIXTURE: mixture}

    def train(
        self,
        recording: Recording,
        recipe: Recipe,
        seed: int,
        progress: NetworkProgress = lambda *_: None,
    ) -> TrainedNetworks:
        rows = recorded_rows(recording)
        mixture = fitted_mixture(rows, self.components, seed)
        return TrainedNetworks(recording.arm, recipe, seed, {MIXTURE: Trained(mixture)})

    def build(
        self,
        arm: ArmSpec,
        recipe: Recipe,
        trained: TrainedNetworks | None,
        run: RunOptions,
    ) -> ArcDriver:
        if trained is None:
            raise StrategyError("gmr needs a mixture that was fitted to a recording")
        mixture = trained.networks[MIXTURE]
        planner = MixtureRegression(arm, mixture, self)
        return ArcDriver(self.name, arm, planner)


class MixtureRegression:
    """Goes to the mean bends given targets; it has no memory."""

    def __init__(self, arm: ArmSpec, mixture: Mixture, options: GaussianMixture):
        """Invert the covariances once."""
        self._length = arm.length
        self._share = options.share
        size = np.shape(mixture.means)[-1]
        deviations = np.full(size, options.bend_noise)
        deviations[:6] = TARGET_NOISE
        noise = deviations**2
        with_axis = np.arange(size)
        without = np.delete(with_axis, AXIS)
        self._conditionals: Mapping[bool, _Conditional] = {
            True: _Conditional.of(mixture, with_axis, noise),
            False: _Conditional.of(mixture, without, noise),
        }

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the bends of the targets; without one for the tip, the last bends."""
        last = moment.bends
        if goal.position_weights[-1] == 0.0:
            return last
        position = goal.positions[-1] / self._length
        parts = [position, last.reshape(-1)]
        has_axis = bool(goal.axis_weights[-1] > 0.0)
        if has_axis:
            parts.insert(1, goal.axes[-1])
        conditional = self._conditionals[has_axis]
        mean = conditional.mean(np.concatenate(parts))
        change = mean.reshape(-1, 2) - last
        return last + self._share * change


class _Conditional(NamedTuple):
    """Bends given noisy measurements of parts of a mixture's vector.

    Attributes:
        expected: measurements of the components, shape (components, known).
        whitening: of their deviations, shape (components, known, known).
        heights: logarithms of weights times peaks, shape (components,).
        bends: of the components [rad], shape (components, 2 modules).
        gains: of bends by deviations, shape (components, 2 modules, known).
    """

    expected: np.ndarray
    whitening: np.ndarray
    heights: np.ndarray
    bends: np.ndarray
    gains: np.ndarray

    @classmethod
    def of(
        cls, mixture: Mixture, known: np.ndarray, noise: np.ndarray
    ) -> "_Conditional":
        weights = np.asarray(mixture.weights, float)
        means = np.asarray(mixture.means, float)
        covariances = np.asarray(mixture.covariances, float)
        measured = covariances[:, known[:, None], known]
        measured = measured + np.diag(noise[known])
        try:
            whitening = np.linalg.inv(np.linalg.cholesky(measured))
        except np.linalg.LinAlgError as error:
            raise StrategyError(
                "a covariance of the mixture is not positive definite; train it anew"
            ) from error
        diagonals = np.diagonal(whitening, axis1=1, axis2=2)
        peaks = np.log(diagonals).sum(axis=-1)
        weights = np.maximum(weights, 1e-300)
        heights = np.log(weights) + peaks
        inverse = np.swapaxes(whitening, 1, 2) @ whitening
        gains = covariances[:, 6:, known] @ inverse
        return cls(means[:, known], whitening, heights, means[:, 6:], gains)

    def mean(
        self, measured: Float[np.ndarray, " known"]
    ) -> Float[np.ndarray, " bends"]:
        """Mean bends of all components, weighted by how likely each measures so [rad]."""
        deviations = (measured - self.expected)[..., None]
        whitened = self.whitening @ deviations
        squares = (whitened**2).sum(axis=(-1, -2))
        heights = self.heights - squares / 2.0
        heights = heights - heights.max()
        shares = np.exp(heights)
        changes = self.gains @ deviations
        bends = self.bends + changes[..., 0]
        return shares @ bends / shares.sum()


def recorded_rows(recording: Recording) -> Float[np.ndarray, "samples size"]:
    """Tip positions [arm lengths], axes and bends by the encoders [rad] of a recording.

    Raises:
        RecordingError: episodes or true states of the tip are missing.
    """
    recording.check_complete()
    arm = recording.arm
    states = recording.sensor("states")
    tips = np.array(states[:, :, -1], float)
    tips[..., POSITION] /= arm.length
    cables = jnp.asarray(recording.sensor("cables"), jnp.float32)
    bends = np.asarray(PCC.of(arm).bends(cables))
    bends = bends.reshape(*bends.shape[:2], -1)
    padded = np.concatenate([tips, bends], axis=-1)
    episodes = []
    for episode, length in zip(padded, recording.lengths, strict=True):
        episodes.append(episode[:length])
    rows = np.concatenate(episodes)
    is_complete = np.isfinite(rows).all(axis=-1)
    rows = rows[is_complete]
    spacing = math.ceil(len(rows) / MOST_SAMPLES)
    return rows[:: max(spacing, 1)]


def fitted_mixture(
    rows: Float[np.ndarray, "samples size"], components: int, seed: int
) -> Mixture:
    """Fit by expectation-maximization, from k-means on.

    Raises:
        RecordingError: there are too few samples.
        S2C2AError: scikit-learn is not installed.
    """
    if len(rows) < SAMPLES_EACH * components:
        raise RecordingError(
            f"{components} components need {SAMPLES_EACH * components} samples with "
            f"true states of the tip, and this recording has {len(rows)}; record more "
            "episodes with motion capture on, or choose fewer components"
        )
    with needs_extra("planners", "Gaussian mixture regression"):
        from sklearn import mixture  # noqa: PLC0415  # an extra
    fit = mixture.GaussianMixture(
        components, reg_covar=LEAST_VARIANCE, random_state=seed
    ).fit(rows)
    parts = (fit.weights_, fit.means_, fit.covariances_)
    return Mixture(*(jnp.asarray(part, jnp.float32) for part in parts))
