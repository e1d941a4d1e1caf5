"""The forward model of the `best` recipe: the chain, and what data near a configuration say beside it.

The chain's structure goes on where there are no data; where there are, a local model
(`Kernels`) tells what the chain leaves out. It sees what the cables carry, remember and
change. `Known` says how far off both may be.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from s2c2a.arm import ArmSpec
from s2c2a.data import CollectOptions
from s2c2a.data.windows import Samples, Split
from s2c2a.kinematics import bends_from_configurations, limit_lengths
from s2c2a.models.cables import HysteresisMemory
from s2c2a.models.chain import ChainC2S
from s2c2a.models.chain_training import ChainOptions, answer, said, samples_along
from s2c2a.models.disturbances import Disturbances
from s2c2a.models.forward_model import ForwardModel
from s2c2a.models.kernels import Kernels, fitted_kernels
from s2c2a.models.transfer import babbled, same_places
from s2c2a.models.uncertainty import Known, known_from
from s2c2a.training.fit import FitOptions, FitResult, Progress, check_limits, quiet
from s2c2a.training.trained import Trained, TrainingData, tried

# an error of one: in parts of the arm's length, and of axes
UNIT = 0.4
AXIS_UNIT = 1.0
FULL_BEND = 0.82  # rad; what `play_widths` are said for
MIN_REACH = 1e-3  # rad; of an arm that hardly moved
NEARBY = 0.2  # rad; how far slopes are believed
EVERY_OTHER = slice(1, None, 2)  # of the plays
SHARES = 0.0, 0.5, 1.0  # of the chain, which local models are fitted beside
WEIGHTS = 0.5, 0.75, 1.0  # of these


class Tangent(NamedTuple):
    """What the local model says near a configuration.

    Attributes:
        bends: there [rad], shape (modules, 2).
        features: there, shape (features,).
        said: outputs there, shape (outputs,).
        slopes: of them by features, shape (outputs, features).
    """

    bends: Float[Array, "modules 2"]
    features: Float[Array, " features"]
    said: Float[Array, " outputs"]
    slopes: Float[Array, "outputs features"]


class LocalC2S(ForwardModel):
    """A chain and a local model.

    Attributes:
        chain: hysteresis, statics, arcs.
        kernels: what it leaves out, in units.
        share: of the chain in what is said, shape (modules, 6).
        known: where the data were, and how far off both were there.
        unit: of positions [m].
        tangent: what takes the kernels' place near a configuration.
    """

    chain: ChainC2S
    kernels: Kernels
    share: Float[Array, "modules 6"]
    known: Known
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
        """See `ForwardModel`: the kernels are looked at once, not for every candidate of a control step."""
        bends = bends_from_configurations(configurations)
        chain = self.chain.near(configurations, memory)
        features = replace(self, chain=chain)._features_at(bends, memory)
        silent = jnp.zeros(self.kernels.constant.shape)
        nothing = jnp.zeros((*silent.shape, *features.shape)), silent

        def looked_at() -> tuple[Array, Array]:
            return jax.jacrev(lambda at: (self.kernels(at),) * 2, has_aux=True)(
                features
            )

        # the chain may do alone, and then nothing is looked at
        speaks = self.kernels.speaks > 0.0
        slopes, value = jax.lax.cond(speaks, looked_at, lambda: nothing)
        return replace(
            self, chain=chain, tangent=Tangent(bends, features, value, slopes)
        )

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
            return self._corrected(states, self.kernels(self.features(inputs)))
        along_tangent = self._along(self.tangent, configurations, memory)
        return self._corrected(states, along_tangent)

    def _along(
        self,
        tangent: Tangent,
        configurations: Float[Array, "*batch modules 3"],
        memory: HysteresisMemory,
    ) -> Array:
        """The local model along its slopes, as far as they are believed."""
        away = limit_lengths(
            bends_from_configurations(configurations) - tangent.bends, NEARBY
        )
        moved = self._features_at(tangent.bends + away, memory) - tangent.features
        return tangent.said + jnp.einsum("of,...f->...o", tangent.slopes, moved)

    def _features_at(
        self, bends: Float[Array, "*batch modules 2"], memory: HysteresisMemory
    ) -> Array:
        moved = jnp.einsum("mnk,...mk->...mn", self.chain.body.matrices, bends)
        return self.features(self.chain.inputs(moved, memory))

    def predictive_std(
        self, configurations: Float[Array, "*batch modules 3"], memory: HysteresisMemory
    ) -> Array:
        """See `ForwardModel`."""
        return jnp.hypot(
            self.known.usual_error, self.extrapolation(configurations)[..., None]
        )

    def extrapolation(self, configurations: Float[Array, "*batch modules 3"]) -> Array:
        """See `ForwardModel`."""
        return self.known.meters(
            self.place(self.chain.body.displacements(configurations))
        )

    def states(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch modules 6"]:
        """States for what the hysteresis weighs."""
        return self._corrected(
            self.chain.states(inputs), self.kernels(self.features(inputs))
        )

    def place(
        self, displacements: Float[Array, "*batch modules cables"]
    ) -> Float[Array, "*batch features"]:
        """By which doubt is told: bends that cables stand for, and how far they moved together."""
        bends = self.chain.body.bends(displacements)
        together = jnp.mean(displacements, axis=-1, keepdims=True)
        return jnp.concatenate([bends, together], axis=-1).reshape(
            *bends.shape[:-2], -1
        )

    def features(
        self, inputs: Float[Array, "*batch modules inputs cables"]
    ) -> Float[Array, "*batch features"]:
        """What the local model sees: bends that cables stand for, and how far they moved together.

        Now, after some of the plays, and how far the filters were behind at the last
        reading. That is told from what was read: a plan is ahead of the arm, and would
        look like speed.
        """
        hysteresis = self.chain.hysteresis
        operators = self.chain.hysteresis.operators
        plays = len(operators.widths)
        shares = operators.shares[:, None]
        now = inputs[..., :1, :]
        felt = inputs[..., 1 : plays + 1, :]
        last = inputs[..., plays + 1 : plays + 2, :]
        crept_before = (inputs[..., plays + 2 :, :] - shares * now) / (1.0 - shares)
        behind = last - crept_before
        if hysteresis.arrived:
            behind = behind.at[..., : hysteresis.delays, :].set(0.0)
        seen = jnp.concatenate([now, felt[..., EVERY_OTHER, :], behind], axis=-2)
        bends = jnp.einsum("mkn,...mjn->...mjk", self.chain.body.inverses, seen)
        together = jnp.mean(seen, axis=-1, keepdims=True)
        return jnp.concatenate([bends, together], axis=-1).reshape(*seen.shape[:-3], -1)

    def weighed(
        self, share: float, weight: float, known: Bool[np.ndarray, "modules 6"]
    ) -> "LocalC2S":
        """Between the chain alone and a local model that was fitted beside so much of it: both together err less.

        What is not known of states, the chain alone says.
        """
        left_out = weight * (1.0 - share) * self.kernels.speaks * known
        return replace(self, kernels=self.kernels.times(weight), share=1.0 - left_out)

    def _corrected(
        self,
        states: Float[Array, "*batch modules 6"],
        said: Float[Array, "*batch outputs"],
    ) -> Array:
        """Positions and axes of the chain, and what is said beside them."""
        beside = said.reshape(*said.shape[:-1], -1, 6)
        states = self.share * states
        positions = states[..., :3] + self.unit * beside[..., :3]
        axes = states[..., 3:] + AXIS_UNIT * beside[..., 3:]
        return jnp.concatenate(
            [positions, axes / jnp.linalg.norm(axes, axis=-1, keepdims=True)], axis=-1
        )


@dataclass(frozen=True)
class LocalOptions(ChainOptions):
    """The chain's, and how much the local model holds.

    Attributes:
        points: that stand for all samples.
        few: the same, for doubt.
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
    model: str = field(default="local", kw_only=True)

    def __post_init__(self):
        """Refuse what cannot be built."""
        super().__post_init__()
        check_limits(self, points=(8, 10_000), few=(4, 1000))

    def untrained(self, arm: ArmSpec, key: PRNGKeyArray) -> LocalC2S:  # type: ignore[override]
        """The chain before training, and a local model that says nothing."""
        chain = super().untrained(arm, key)
        modules = arm.module_count
        kernels = Kernels.silent(len(self._kinds(chain)), 6 * modules, self.points)
        none = jnp.ones((modules, 6)), Known.none(3 * modules, self.few, modules)
        return LocalC2S(chain, kernels, *none, UNIT * arm.length)

    def train(  # type: ignore[override]
        self,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then what it leaves out."""
        widths = tuple(width * _reach(data) / FULL_BEND for width in self.play_widths)
        chain = ChainOptions(
            self.hidden, self.depth, widths, self.creep_times, self.statics
        )
        return self._with_local(chain.train(data, fit, key, progress), data, key)

    def go_on(  # type: ignore[override]
        self,
        model: LocalC2S,
        data: TrainingData,
        fit: FitOptions,
        key: PRNGKeyArray,
        progress: Progress = quiet,
    ) -> Trained[LocalC2S]:
        """See `ForwardOptions`: the chain first, then what it leaves out; what was known before stays known."""
        trained = self._with_local(
            super().go_on(model.chain, data, fit, key, progress), data, key
        )
        known = replace(model.known, usual_error=trained.network.known.usual_error)
        return replace(trained, network=replace(trained.network, known=known))

    def carried(  # type: ignore[override]
        self,
        model: LocalC2S,
        old: ArmSpec,
        new: ArmSpec,
        babbling: CollectOptions,
        key: PRNGKeyArray,
    ) -> LocalC2S:
        """See `ForwardOptions`: the chain, and where it was shown; local models are of one arm alone."""
        chain = super().carried(model.chain, old, new, babbling, key)
        blank = self.untrained(new, key)
        begun = replace(blank, chain=chain, known=model.known)
        if old.module_count == new.module_count:
            return begun
        longer = (
            jnp.asarray(same_places(old.module_count, new.module_count))
            * new.length
            / old.length
        )
        known = self._known(begun, samples_along(chain, babbled(new, babbling)), new)
        return replace(
            begun, known=replace(known, usual_error=longer @ model.known.usual_error)
        )

    def _with_local(
        self, result: Trained[ChainC2S], data: TrainingData, key: PRNGKeyArray
    ) -> Trained[LocalC2S]:
        """A trained chain, and beside it what does best on samples held out."""
        blank = replace(self.untrained(data.arm, key), chain=result.network)
        split = samples_along(result.network, data)
        known = np.isfinite(split.training.targets).any(axis=0)
        tries = {(1.0, 0.0): blank}  # first: of ties it wins
        for share in SHARES:
            beside = self._beside(blank, split.training, share)
            tries |= {
                (share, weight): beside.weighed(share, weight, known)
                for weight in WEIGHTS
            }
        (share, weight), best = min(
            tries.items(), key=lambda one: _loss(one[1], split.validation)
        )
        model = replace(best, known=self._known(best, split, data.arm))
        trained = tried(FitResult(model, result.curve), answer, split)
        if best is blank:
            return trained
        # what was held out is known from now on
        whole = self._beside(model, _together(split), share)
        return replace(trained, network=whole.weighed(share, weight, known))

    def _beside(self, blank: LocalC2S, samples: Samples, share: float) -> LocalC2S:
        """A local model of what so much of the chain leaves out."""
        inputs = jnp.asarray(samples.inputs["configurations"])
        features, chained = (
            np.asarray(eqx.filter_jit(how)(inputs))
            for how in (blank.features, blank.chain.states)
        )
        kinds = self._kinds(blank.chain)
        left = samples.targets - share * chained
        left = np.concatenate(
            [left[..., :3] / blank.unit, left[..., 3:] / AXIS_UNIT], axis=-1
        )
        kernels = fitted_kernels(
            features, left.reshape(len(left), -1), kinds, self.points
        )
        return replace(blank, kernels=kernels)

    def _known(self, model: LocalC2S, split: Split, arm: ArmSpec) -> Known:
        """By the samples held out from training."""
        parts = (
            part.inputs["configurations"][:, :, 0]
            for part in (split.training, split.validation)
        )
        seen, held_out = (np.asarray(model.place(jnp.asarray(part))) for part in parts)
        return known_from(
            seen, held_out, _distances(model, split.validation), self.few, arm.length
        )

    def _kinds(self, chain: ChainC2S) -> Float[np.ndarray, "features kinds"]:
        """Features of a module and direction share a factor of their lengths, and those of one age and memory."""
        operators = chain.hysteresis.operators
        modules = len(chain.body.lengths)
        places = 3 * modules
        seen = 1 + len(operators.widths[EVERY_OTHER]) + len(operators.shares)
        module, kind, axis = np.unravel_index(
            np.arange(places * seen), (modules, seen, 3)
        )
        return np.hstack([np.eye(places)[3 * module + axis], np.eye(seen)[kind]])


def _reach(data: TrainingData) -> float:
    """The largest displacement over the cable radius, or bend [rad]: plays are in parts of what the arm moves by."""
    if data.displacements is not None:
        return max(float(np.abs(data.displacements).max()), MIN_REACH)
    return max(
        float(np.arccos(np.clip(np.min(data.sensed[..., 2]), -1.0, 1.0))), MIN_REACH
    )


def _together(split: Split) -> Samples:
    """All samples, for what is told by none of them in particular."""
    parts = split.training, split.validation, split.test
    inputs, targets = zip(
        *((part.inputs["configurations"], part.targets) for part in parts), strict=True
    )
    return Samples({"configurations": np.concatenate(inputs)}, np.concatenate(targets))


def _distances(
    model: LocalC2S, samples: Samples
) -> Float[np.ndarray, "samples modules"]:
    """Of ends from where they were said to be [m]."""
    states = said(model, jnp.asarray(samples.inputs["configurations"]))
    return np.linalg.norm(
        np.asarray(states)[..., :3] - samples.targets[..., :3], axis=-1
    )


def _loss(model: LocalC2S, samples: Samples) -> float:
    return float(np.nanmean(_distances(model, samples) ** 2))
