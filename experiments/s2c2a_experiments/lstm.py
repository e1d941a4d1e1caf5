"""The data-driven comparison of the paper: an LSTM from tip positions to actions.

It has no plan and reads true states, so it works only in simulation or under motion
capture.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data import CollectOptions, Recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.estimation import Estimate
from s2c2a.execution.compilation import compiled
from s2c2a.kinematics import (
    bends_from_cables,
    configurations_from_states,
    limit_lengths,
)
from s2c2a.paper import HEADROOM
from s2c2a.planning import Goal
from s2c2a.runtime.driver import choose
from s2c2a.spaces import ACTION_HISTORY, POSITION, Actions, Reading
from s2c2a.strategies.options import NetworkProgress, RunOptions, StrategyOptions
from s2c2a.strategies.recipe import Recipe
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a_experiments.tip_lstm import LSTMOptions, TipHistory, TipLSTM

NETWORK = "LSTM"  # as weight files have it


@dataclass(frozen=True)
class LSTMComparison(StrategyOptions):
    """An LSTM from tip positions to actions.

    Its data are as fast as those of the recipe `paper`, whatever the recipe: it follows
    better with them than with slower ones.

    Attributes:
        options: size and training of the network.
    """

    options: LSTMOptions = LSTMOptions()  # noqa: RUF009  # frozen
    name = "lstm"
    recipe_keys = frozenset()
    ignores = frozenset({"axes", "other ends", "obstacles"})

    def collect_options(self, recipe: Recipe, seed: int) -> CollectOptions:
        return CollectOptions(seed=seed)

    def training_key(self, recipe: Recipe) -> Any:
        """See `StrategyOptions`: the recipe matters to the recording alone."""
        return repr(self)

    def untrained(
        self, arm: ArmSpec, recipe: Recipe, key: PRNGKeyArray
    ) -> dict[str, Any]:
        return {NETWORK: self.options.untrained(arm, key)}

    def train(
        self,
        recording: Recording,
        recipe: Recipe,
        seed: int,
        progress: NetworkProgress = lambda *_: None,
    ) -> TrainedNetworks:
        def lstm_progress(epoch: int, epochs: int, loss: float) -> None:
            progress(NETWORK, epoch, epochs, loss)

        recording.check_complete()
        tips = recording.sensor("states")[:, :, -1, POSITION]
        if not np.isfinite(tips).any():
            raise RecordingError(
                "this recording lacks true states, which the LSTM reads; record with "
                "motion capture on"
            )
        trained = self.options.train(
            recording.arm,
            tips,
            recording.actions,
            recording.lengths,
            jax.random.key(seed),
            lstm_progress,
        )
        return TrainedNetworks(recording.arm, recipe, seed, {NETWORK: trained})

    def build(
        self,
        arm: ArmSpec,
        recipe: Recipe,
        trained: TrainedNetworks | None,
        run: RunOptions,
    ) -> "LSTMStrategy":
        if trained is None:
            raise StrategyError("lstm needs a trained network")
        return LSTMStrategy(arm, trained.networks[NETWORK])


class LSTMStrategy:
    """A trained LSTM as a driver of the control loop.

    It uses the goal's tip position alone. The bends that its actions stand for change by
    at most the arm's step limit, as every plan does. Nothing compiles after it is built.

    Attributes:
        name: "lstm".
        arm: that it drives.
        sensors: names of the sensors that every reading must hold.
    """

    name = "lstm"
    sensors = ("states",)

    def __init__(self, arm: ArmSpec, network: TipLSTM):
        """Compile for an arm and its trained network."""
        self.arm = arm
        policy = _Policy.of(arm, network)
        self._start_policy = compiled(_Policy.start, policy)
        self._act = compiled(_Policy.act, policy)
        self._configurations = compiled(configurations_from_states)
        self._memory: _Memory | None = None
        # compile everything: no control step waits for it
        heights = np.cumsum(ArmGeometry.of(self.arm).lengths)
        states = np.array([[0.0, 0.0, height, 0.0, 0.0, 1.0] for height in heights])
        reading = Reading(0.0, {"states": states})
        goal = Goal.of(self.arm.module_count).with_position(states[-1, POSITION])
        self.start(reading)
        self.step(reading, goal)
        self._memory = None

    def start(self, reading: Reading) -> None:
        """Begin with an arm at rest.

        Raises:
            StrategyError: the reading holds no true states.
        """
        self._memory = self._start_policy(_states(reading)[-1, POSITION])

    def estimate(self, reading: Reading, last_command: Actions) -> Estimate:
        """The true configurations; the tip position is the estimate's memory.

        Raises:
            StrategyError: the strategy was not started, or the reading holds no true
                states.
        """
        self._check_started()
        states = _states(reading)
        self._sensed = self._configurations(states)
        return Estimate(self._sensed, memory=states[-1, POSITION])

    def plan(self, estimate: Estimate, goal: Goal) -> Float[np.ndarray, "3"]:
        """The desired tip position: the LSTM does not plan.

        Raises:
            StrategyError: the goal holds no tip position.
        """
        desired = np.asarray(goal.positions[-1], np.float32)
        if not (goal.position_weights[-1] > 0 and np.isfinite(desired).all()):
            raise StrategyError(
                "the LSTM follows tip positions, and this goal holds none; add one with "
                "`with_position`"
            )
        return desired

    def act(self, plan: Float[np.ndarray, "3"], estimate: Estimate) -> Actions:
        """The action that leads to the desired tip position.

        Returns:
            Displacements [m] or tensions [N], shape (modules, cables).
        """
        action, self._memory = self._act(estimate.memory, plan, self._memory)
        return np.asarray(action, dtype=np.float64)

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """Estimate, plan and act, for callers without a control loop."""
        return choose(self, reading, np.zeros(()), goal)

    def sent(self, action: Actions) -> None:
        """Ignore it: the next step starts from what the LSTM chose."""

    def diagnostics(self) -> dict[str, np.ndarray]:
        """Measured configurations, shape (modules, 3).

        Raises:
            StrategyError: the strategy was not started.
        """
        self._check_started()
        return {"sensed": np.asarray(self._sensed)}

    def _check_started(self) -> None:
        if self._memory is None:
            raise StrategyError(
                "this strategy was not started; call start(reading) with the arm at rest"
            )


class _Memory(NamedTuple):
    """What the policy carries from step to step.

    Attributes:
        history: of positions and actions.
        bends: that the last action stands for [rad].
    """

    history: TipHistory
    bends: Float[Array, "modules 2"]


class _Policy(eqx.Module):
    """From tip positions to actions, within the arm's step limit.

    Attributes:
        network: the trained LSTM.
        bend_units: bend [rad] of a normalized action of one, shape (modules, 1).
        longest_step: largest change of a module's bend in one step [rad].
    """

    network: TipLSTM
    bend_units: Float[Array, "modules 1"]
    longest_step: float

    @classmethod
    def of(cls, arm: ArmSpec, network: TipLSTM) -> "_Policy":
        geometry = ArmGeometry.of(arm)
        units = HEADROOM * geometry.bend_limits[:, None]
        bend_units = jnp.asarray(units, dtype=jnp.float32)
        return cls(network, bend_units, geometry.step_limit)

    def start(self, tip: Float[Array, "3"]) -> _Memory:
        """A history of rest, as before every episode of the training data."""
        neutral = self.network.sum_and_range.neutral
        positions = jnp.tile(tip, (ACTION_HISTORY, 1))
        actions = jnp.zeros((ACTION_HISTORY, *neutral.shape))
        return _Memory(TipHistory(positions, actions), jnp.zeros((len(neutral), 2)))

    def act(
        self, tip: Float[Array, "3"], desired: Float[Array, "3"], memory: _Memory
    ) -> tuple[Array, _Memory]:
        """The action [m or N], shape (modules, cables), and the next memory."""
        layer = self.network.sum_and_range
        positions = _pushed(memory.history.positions, tip)
        history = TipHistory(positions, memory.history.actions)
        unlimited = self.network.unlimited(desired, history)
        bends = bends_from_cables(layer.pseudo_inverses, unlimited)
        change = bends * self.bend_units - memory.bends
        bends = memory.bends + limit_lengths(change, self.longest_step)
        scaled = jnp.einsum("mck,mk->mc", layer.matrices, bends / self.bend_units)
        action = layer.limited(scaled)
        actions = _pushed(history.actions, action)
        next_memory = _Memory(TipHistory(positions, actions), bends)
        return layer.actions(action), next_memory


def _pushed(
    history: Float[Array, "steps *features"], newest: Float[Array, "*features"]
) -> Float[Array, "steps *features"]:
    return jnp.concatenate([history[1:], newest[None]])


def _states(reading: Reading) -> np.ndarray:
    """True states.

    Raises:
        StrategyError: the tip's state is missing.
    """
    states = reading.get("states")
    if states is None or not np.isfinite(states[-1, POSITION]).all():
        raise StrategyError(
            "the LSTM reads true states, and this reading holds none of the tip; use "
            "motion capture"
        )
    return np.asarray(states, np.float32)
