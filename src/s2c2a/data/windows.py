"""From recordings to samples for the networks, split by stretches of time."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from s2c2a.errors import RecordingError
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY

SHARES = (0.70, 0.15, 0.15)
"""Training, validation and test shares of every episode, in this order of time."""


@dataclass(frozen=True)
class Samples:
    """Inputs and targets of a network, first axis: samples."""

    inputs: dict[str, np.ndarray]
    targets: np.ndarray


@dataclass(frozen=True)
class Split:
    """Samples for training, for early stopping, and held out."""

    training: Samples
    validation: Samples
    test: Samples


SHORTEST_EPISODE = 50
"""Samples without which the shortest stretch has no whole window."""


def stretches(samples: int) -> list[slice]:
    """Training, validation and test stretch of an episode of so many samples.

    Raises:
        RecordingError: the episode is too short to be split.
    """
    if samples < SHORTEST_EPISODE:
        raise RecordingError(f"episodes of {samples} samples cannot be split; collect at least {SHORTEST_EPISODE} each")
    edges = np.rint(np.cumsum([0.0, *SHARES]) * samples).astype(int)
    return [slice(start, stop) for start, stop in pairwise(edges)]


def forward_samples(
    configurations: Float[np.ndarray, "episodes samples modules 3"],
    states: Float[np.ndarray, "episodes samples modules 6"],
) -> Split:
    """Samples for C2S: sensed configuration in, true state of the same moment out."""
    parts = [
        Samples({"configurations": _merge(configurations[:, part])}, _merge(states[:, part]))
        for part in stretches(configurations.shape[1])
    ]
    return Split(*parts)


def controller_samples(
    configurations: Float[np.ndarray, "episodes samples modules 3"],
    actions: Float[np.ndarray, "episodes samples modules cables"],
    neutral: Float[np.ndarray, "modules cables"],
) -> Split:
    """Samples for C2A (Chen et al. 2025, eq. (8)): C_{t+1}; C_t to C_{t-3}; A_{t-1} to A_{t-5} in, A_t out.

    No window crosses the border of an episode or a stretch. Before an episode the arm was at rest: its first
    configuration and the neutral action stand in, as they do when a controller starts.
    """
    ages = range(CONFIGURATION_HISTORY), range(1, ACTION_HISTORY + 1)
    return Split(
        *(_windows("configurations", *pair, *ages, axis=-2) for pair in _from_rest(configurations, actions, neutral))
    )


def lstm_samples(
    positions: Float[np.ndarray, "episodes samples 3"],
    actions: Float[np.ndarray, "episodes samples modules cables"],
    neutral: Float[np.ndarray, "modules cables"],
) -> Split:
    """Samples for the LSTM (Chen et al. 2025, sec. IV-A2): p_{t+1}; p_{t-4} to p_t; A_{t-5} to A_{t-1} in, A_t out.

    Its sequence is time, so histories have the oldest moment first. Borders and starts as in `controller_samples`.

    Args:
        positions: of the tip [m], base frame.
        actions: as really sent [m or N].
        neutral: the action at rest [m or N].
    """
    ages = range(ACTION_HISTORY - 1, -1, -1), range(ACTION_HISTORY, 0, -1)
    return Split(*(_windows("positions", *pair, *ages, axis=2) for pair in _from_rest(positions, actions, neutral)))


def _from_rest(sensed: np.ndarray, actions: np.ndarray, neutral: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """What was sensed and sent in every stretch, rest put before the first one."""
    rest = np.broadcast_to(neutral, (len(actions), ACTION_HISTORY, *neutral.shape))
    still = np.repeat(sensed[:, :1], ACTION_HISTORY, axis=1)
    first, *later = stretches(actions.shape[1])
    beginning = np.concatenate([still, sensed[:, first]], axis=1), np.concatenate([rest, actions[:, first]], axis=1)
    return [beginning, *((sensed[:, part], actions[:, part]) for part in later)]


def _windows(
    name: str, sensed: np.ndarray, actions: np.ndarray, sensed_ages: range, action_ages: range, axis: int
) -> Samples:
    """All windows with a whole history behind them and one sensed moment after them; ages [steps] get an axis."""
    steps = np.arange(ACTION_HISTORY, sensed.shape[1] - 1)
    inputs = {
        "wanted": sensed[:, steps + 1],
        name: np.stack([sensed[:, steps - age] for age in sensed_ages], axis),
        "actions": np.stack([actions[:, steps - age] for age in action_ages], axis),
    }
    return Samples({key: _merge(values) for key, values in inputs.items()}, _merge(actions[:, steps]))


def _merge(values: np.ndarray) -> np.ndarray:
    return values.reshape(-1, *values.shape[2:]).astype(np.float32)
