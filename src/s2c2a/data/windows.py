"""From recordings to samples for the networks, split by stretches of time."""

from collections.abc import Sequence
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
PIECE = 500
"""Samples of an episode, about, of which each part gets a share."""
WHOLE = (0, 0, 0, 0, 1, 0, 2)
"""Which part shorter episodes are of, in turn."""

Lengths = Sequence[int] | None
Stretch = tuple[int, slice]


def stretches(lengths: Sequence[int]) -> list[list[Stretch]]:
    """Training, validation and test stretches of episodes of so many samples: which episode, and which samples.

    Long episodes are cut, very long ones piece by piece; shorter ones, as logs with
    gaps have them, are of one part as a whole.

    Raises:
        RecordingError: a part would stay empty.
    """
    parts: list[list[Stretch]] = [[], [], []]
    short = 0
    for episode, samples in enumerate(lengths):
        if 0 < samples < SHORTEST_EPISODE:
            parts[WHOLE[short % len(WHOLE)]].append((episode, slice(0, samples)))
            short += 1
            continue
        for begin, end in pairwise(
            np.linspace(0, samples, 1 + max(1, round(samples / PIECE))).astype(int)
        ):
            edges = begin + np.rint(np.cumsum([0.0, *SHARES]) * (end - begin)).astype(
                int
            )
            for part, (start, stop) in zip(
                parts, pairwise(edges.tolist()), strict=True
            ):
                part.append((episode, slice(start, stop)))
    if not all(parts):
        raise RecordingError(
            f"{len(lengths)} episodes of {max(lengths)} samples cannot be split; collect at least "
            f"{SHORTEST_EPISODE} each, or {len(WHOLE)} shorter ones"
        )
    return parts


def forward_samples(
    configurations: Float[np.ndarray, "episodes samples modules 3"],
    states: Float[np.ndarray, "episodes samples modules 6"],
    lengths: Lengths = None,
) -> Split:
    """Samples for C2S: sensed configuration in, true state of the same moment out, where any of it is known.

    Args:
        configurations: as they were sensed.
        states: true ones; NaN where they are not known.
        lengths: samples of each episode, where they differ; what is behind them counts
            nothing.
    """
    known = np.isfinite(states).any(axis=(2, 3))
    known &= np.arange(known.shape[1]) < np.asarray(_all(states, lengths))[:, None]
    rows = [np.flatnonzero(one) for one in known]

    def samples(part: list[Stretch]) -> Samples:
        inputs, targets = (
            np.concatenate(
                [values[episode, rows[episode][place]] for episode, place in part]
            ).astype(np.float32)
            for values in (configurations, states)
        )
        return Samples({"configurations": inputs}, targets)

    return Split(*map(samples, stretches([len(one) for one in rows])))


def _all(values: np.ndarray, lengths: Lengths) -> Sequence[int]:
    return [values.shape[1]] * len(values) if lengths is None else lengths


def controller_samples(
    configurations: Float[np.ndarray, "episodes samples modules 3"],
    actions: Float[np.ndarray, "episodes samples modules cables"],
    neutral: Float[np.ndarray, "modules cables"],
    lengths: Lengths = None,
) -> Split:
    """Samples for C2A (Chen et al. 2025, eq. (8)): C_{t+1}; C_t to C_{t-3}; A_{t-1} to A_{t-5} in, A_t out.

    No window crosses the border of an episode or a stretch. Before an episode the arm
    was at rest: its first configuration and the neutral action stand in, as they do
    when a controller starts.
    """
    ages = range(CONFIGURATION_HISTORY), range(1, ACTION_HISTORY + 1)
    return Split(
        *(
            _windows("configurations", part, *ages, axis=-2)
            for part in _from_rest(
                configurations, actions, neutral, _all(actions, lengths)
            )
        )
    )


def lstm_samples(
    positions: Float[np.ndarray, "episodes samples 3"],
    actions: Float[np.ndarray, "episodes samples modules cables"],
    neutral: Float[np.ndarray, "modules cables"],
) -> Split:
    """Samples for the LSTM (Chen et al. 2025, sec. IV-A2): p_{t+1}; p_{t-4} to p_t; A_{t-5} to A_{t-1} in, A_t out.

    Its sequence is time, so histories have the oldest moment first. Borders and starts
    as in `controller_samples`.

    Args:
        positions: of the tip [m], base frame.
        actions: as really sent [m or N].
        neutral: the action at rest [m or N].
    """
    ages = range(ACTION_HISTORY - 1, -1, -1), range(ACTION_HISTORY, 0, -1)
    parts = _from_rest(positions, actions, neutral, _all(actions, None))
    return Split(*(_windows("positions", part, *ages, axis=1) for part in parts))


def _from_rest(
    sensed: np.ndarray, actions: np.ndarray, neutral: np.ndarray, lengths: Sequence[int]
) -> list[list[tuple[np.ndarray, np.ndarray]]]:
    """What was sensed and sent in every stretch of every part, rest put before those that begin an episode."""
    rest = np.broadcast_to(neutral, (ACTION_HISTORY, *neutral.shape))

    def part(episode: int, stretch: slice) -> tuple[np.ndarray, np.ndarray]:
        felt = sensed[episode, stretch]
        sent = actions[episode, stretch]
        if stretch.start:
            return felt, sent
        still = np.repeat(sensed[episode, :1], ACTION_HISTORY, axis=0)
        return np.concatenate([still, felt]), np.concatenate([rest, sent])

    return [[part(*stretch) for stretch in every] for every in stretches(lengths)]


def _windows(
    name: str,
    parts: list[tuple[np.ndarray, np.ndarray]],
    sensed_ages: range,
    action_ages: range,
    axis: int,
) -> Samples:
    """All windows with a whole history behind them and one sensed moment after them; ages [steps] get an axis."""
    rows = [_windows_of(name, *part, sensed_ages, action_ages, axis) for part in parts]
    keys = rows[0].inputs
    inputs = {
        key: np.concatenate([row.inputs[key] for row in rows]).astype(np.float32)
        for key in keys
    }
    return Samples(
        inputs, np.concatenate([row.targets for row in rows]).astype(np.float32)
    )


def _windows_of(
    name: str,
    sensed: np.ndarray,
    actions: np.ndarray,
    sensed_ages,
    action_ages,
    axis: int,
) -> Samples:
    """Those of one stretch."""
    steps = np.arange(ACTION_HISTORY, len(sensed) - 1)
    inputs = {
        "desired": sensed[steps + 1],
        name: np.stack([sensed[steps - age] for age in sensed_ages], axis),
        "actions": np.stack([actions[steps - age] for age in action_ages], axis),
    }
    return Samples(inputs, actions[steps])
