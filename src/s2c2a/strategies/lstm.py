"""The data-driven comparison of the paper: an LSTM from tip positions to actions, without a plan.

It reads true states, so it works only where something outside watches the arm:
simulation or motion capture.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry
from s2c2a.data import Recording
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.kinematics import configurations_from_states, limit_lengths
from s2c2a.models.actions import LSTMOptions, TipHistory, TipLSTM
from s2c2a.models.layers import HEADROOM
from s2c2a.planning import Goal
from s2c2a.compilation import compiled
from s2c2a.spaces import ACTION_HISTORY, POSITION, Actions, Reading
from s2c2a.strategies.strategy import started
from s2c2a.strategies.trained import TrainedNetworks
from s2c2a.training import Progress, quiet

TrainedLSTM = TrainedNetworks[LSTMOptions]


def train_lstm_strategy(
    recording: Recording, options: LSTMOptions, seed: int, progress: Progress = quiet
) -> TrainedLSTM:
    """Train the LSTM on a recording, on the same stretches of it as the networks of the paper.

    Args:
        recording: with true states.
        options: size and training.
        seed: of everything random.
        progress: told epoch, most epochs, validation loss.

    Raises:
        RecordingError: episodes are missing or too short, or the recording holds no
            true states.
        TrainingError: too few samples, or the loss is not finite.
    """
    recording.check_complete()
    tips = recording.sensor("states")[:, :, -1, POSITION]
    if not np.isfinite(tips).all():
        raise RecordingError(
            "this recording lacks true states, which the LSTM reads; record with motion capture on"
        )
    trained = options.train(
        recording.arm, tips, recording.actions, jax.random.key(seed), progress
    )
    return TrainedNetworks.of(recording.arm, options, seed, {"LSTM": trained})


class LSTMStrategy:
    """A trained LSTM at work; it has the doors of `Strategy`.

    It hears a goal's desired tip position and nothing else of it. The bends that its
    actions stand for change by at most the arm's step limit, as every plan does.
    Nothing compiles after it is built.

    Attributes:
        name: "lstm".
        arm: the arm that it drives.
        sensors: names of the sensors that it needs.
    """

    name = "lstm"
    sensors = ("states",)

    def __init__(self, trained: TrainedLSTM):
        """Compile for the arm that the LSTM was trained for."""
        self.arm = trained.arm
        policy = _Policy.of(trained)
        self._begin = compiled(_Policy.start, policy)
        self._act = compiled(_Policy.act, policy)
        self._sense = compiled(configurations_from_states)
        self._memory: _Memory | None = None
        self._warm_up()

    def start(self, reading: Reading) -> None:
        """Begin from an arm at rest.

        Raises:
            StrategyError: the reading holds no true states.
        """
        states = _states(reading)
        self._sensed = self._sense(states)
        self._memory = self._begin(states[-1, POSITION])

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """The action of one control step.

        Args:
            reading: the latest, with true states.
            goal: with the desired tip position after the action.

        Raises:
            StrategyError: it was not started, the reading holds no true states, or the
                goal no tip position.

        Returns:
            Displacements [m] or tensions [N], shape (modules, cables).
        """
        last = started(self._memory, "call start(reading) with the arm at rest first")
        states = _states(reading)
        desired = _desired_tip(goal)
        self._sensed = self._sense(states)
        action, self._memory = self._act(states[-1, POSITION], desired, last)
        return np.asarray(action, dtype=np.float64)

    def sent(self, action: Actions) -> None:
        """The next step begins from what it asked for."""

    def diagnostics(self) -> dict[str, np.ndarray]:
        """What it sensed, configurations of shape (modules, 3); it plans none.

        Raises:
            StrategyError: it was not started.
        """
        started(self._memory, "it has sensed nothing yet")
        return {"sensed": np.asarray(self._sensed)}

    def _warm_up(self) -> None:
        heights = np.cumsum(ArmGeometry.of(self.arm).lengths)
        states = np.array([[0.0, 0.0, height, 0.0, 0.0, 1.0] for height in heights])
        reading = Reading(0.0, {"states": states})
        self.start(reading)
        self.step(
            reading, Goal.of(self.arm.module_count).with_position(states[-1, POSITION])
        )
        self._memory = None


class _Memory(NamedTuple):
    """What is carried from step to step: the past, and the bends [rad] that the last action stands for."""

    history: TipHistory
    bends: Float[Array, "modules 2"]


class _Policy(eqx.Module):
    """From tip positions to actions, no faster than the arm's step limit.

    Attributes:
        network: the trained LSTM.
        bend_units: bend [rad] that a normalized action of one on the bend directions
            stands for, shape (modules, 1).
        longest_step: largest change of a module's bend in one step [rad].
    """

    network: TipLSTM
    bend_units: Float[Array, "modules 1"]
    longest_step: float

    @classmethod
    def of(cls, trained: TrainedLSTM) -> "_Policy":
        units = HEADROOM * ArmGeometry.of(trained.arm).bend_limits[:, None]
        longest_step = float(np.deg2rad(trained.arm.step_limit_deg))
        return cls(
            trained.networks["LSTM"],
            jnp.asarray(units, dtype=jnp.float32),
            longest_step,
        )

    def start(self, tip: Float[Array, "3"]) -> _Memory:
        """A history of rest, as before every episode of the training data."""
        neutral = self.network.sum_and_range.neutral
        history = TipHistory(
            jnp.tile(tip, (ACTION_HISTORY, 1)),
            jnp.zeros((ACTION_HISTORY, *neutral.shape)),
        )
        return _Memory(history, jnp.zeros((len(neutral), 2)))

    def act(
        self, tip: Float[Array, "3"], desired: Float[Array, "3"], memory: _Memory
    ) -> tuple[Array, _Memory]:
        """The action [m or N], shape (modules, cables), and the memory after it."""
        layer = self.network.sum_and_range
        history = TipHistory(
            _push(memory.history.positions, tip), memory.history.actions
        )
        normalized = self.network.unlimited(desired, history)
        change = (
            jnp.einsum("mkc,mc->mk", layer.pseudo_inverses, normalized)
            * self.bend_units
            - memory.bends
        )
        bends = memory.bends + limit_lengths(change, self.longest_step)
        action = layer.limited(
            jnp.einsum("mck,mk->mc", layer.matrices, bends / self.bend_units)
        )
        return layer.actions(action), _Memory(
            TipHistory(history.positions, _push(history.actions, action)), bends
        )


def _push(
    history: Float[Array, "moments *features"], newest: Float[Array, "*features"]
) -> Array:
    return jnp.concatenate([history[1:], newest[None]])


def _states(reading: Reading) -> np.ndarray:
    """True states, refused where the tip is not watched."""
    states = reading.get("states")
    if states is None or not np.isfinite(states[-1, POSITION]).all():
        raise StrategyError(
            "the LSTM reads true states and this reading holds none of the tip; have the arm watched"
        )
    return np.asarray(states, np.float32)


def _desired_tip(goal: Goal) -> np.ndarray:
    """The desired tip position [m], refused where none is asked for."""
    desired = np.asarray(goal.positions[-1], np.float32)
    if not (goal.position_weights[-1] > 0 and np.isfinite(desired).all()):
        raise StrategyError(
            "the LSTM follows tip positions and this goal holds none; add one with `with_position`"
        )
    return desired
