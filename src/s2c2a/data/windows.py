"""Samples for the networks, split into training, validation, and test stretches."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.errors import RecordingError, counted
from s2c2a.spaces import ACTION_HISTORY, CONFIGURATION_HISTORY

Sensed = Float[np.ndarray, "episodes samples modules 3"]
EpisodeStates = Float[np.ndarray, "episodes samples modules 6"]
EpisodeActions = Float[np.ndarray, "episodes samples modules cables"]
# Training, validation and test samples, as shares of a piece in order of time. The gap
# after the training samples, and before those of the next piece, is there because
# neighbors in time are alike: a model that interpolates them would look better than it is.
PARTS = ((0.0, 0.65), (0.70, 0.85), (0.85, 1.0))
Shares = tuple[tuple[float, float], ...]
APART = ((0.0, 0.65), (0.70, 0.825), (0.875, 1.0))
"""The same with a gap between validation and test samples."""


@dataclass(frozen=True)
class Samples:
    """Inputs and targets of a network; samples are the first axis."""

    inputs: dict[str, np.ndarray]
    targets: np.ndarray

    def rows(self, rows: Bool[np.ndarray, " samples"]) -> "Samples":
        """Some of the samples."""
        inputs = {name: values[rows] for name, values in self.inputs.items()}
        return Samples(inputs, self.targets[rows])

    @classmethod
    def joined(cls, parts: Sequence["Samples"]) -> "Samples":
        """Samples of several parts, in single precision."""
        inputs = {
            key: np.concatenate([part.inputs[key] for part in parts]).astype(np.float32)
            for key in parts[0].inputs
        }
        targets = np.concatenate([part.targets for part in parts])
        return cls(inputs, targets.astype(np.float32))


@dataclass(frozen=True)
class Split:
    """Samples for training, early stopping, and testing; some of each."""

    training: Samples
    validation: Samples
    test: Samples

    def __post_init__(self):
        """Refuse a part without samples: no error can be computed of it."""
        counts = [len(part.targets) for part in self.parts]
        if not all(counts):
            raise RecordingError(
                f"{counted(sum(counts), 'usable sample')} cannot be split; collect at least "
                f"{SHORTEST_EPISODE} in a row, or {len(WHOLE)} shorter episodes"
            )

    @property
    def parts(self) -> tuple[Samples, Samples, Samples]:
        """All three."""
        return self.training, self.validation, self.test


SHORTEST_EPISODE = 50  # samples: 15 % of fewer may hold no complete window
# Approximate samples of a piece that is divided among the parts. Its gaps of 25 samples
# are those over which errors of recorded arms are correlated.
PIECE = 500
# part to which shorter episodes belong as a whole, in turn
WHOLE = (0, 0, 0, 0, 1, 0, 2)

Lengths = Sequence[int] | None
Stretch = tuple[int, slice]


def stretches(lengths: Sequence[int], shares: Shares = PARTS) -> list[list[Stretch]]:
    """Training, validation, and test stretches: episode index and slice of samples.

    Long episodes are divided, very long ones in pieces (`PARTS`). Short ones, as in logs
    with gaps, belong to one part as a whole.

    Args:
        lengths: number of samples of each episode.
        shares: of a piece.

    Returns:
        Of each part, one or more; an empty one if there is none.
    """
    parts: list[list[Stretch]] = [[], [], []]
    short = 0
    for episode, samples in enumerate(lengths):
        if 0 < samples < SHORTEST_EPISODE:
            parts[WHOLE[short % len(WHOLE)]].append((episode, slice(0, samples)))
            short += 1
            continue
        pieces = max(1, round(samples / PIECE))
        borders = np.linspace(0, samples, 1 + pieces).astype(int)
        for begin, end in pairwise(borders):
            edges = begin + np.rint(np.array(shares) * (end - begin)).astype(int)
            if end < samples:
                edges[2, 1] -= edges[1, 0] - edges[0, 1]
            for part, (start, stop) in zip(parts, edges.tolist(), strict=True):
                part.append((episode, slice(start, stop)))
    return [part or [(0, slice(0, 0))] for part in parts]


def forward_samples(
    configurations: Sensed,
    states: EpisodeStates,
    lengths: Lengths = None,
    shares: Shares = PARTS,
) -> Split:
    """Samples for C2S: sensed configuration in, true state at the same time out.

    Samples without any known state are dropped.

    Args:
        configurations: sensed configurations.
        states: true states; NaN: unknown.
        lengths: number of samples of each episode, if they differ; the rest is padding.
        shares: of a piece.
    """
    rows = _known_rows(states, lengths)
    parts = stretches([len(indices) for indices in rows], shares)
    return Split(*(_samples_of(configurations, states, rows, part) for part in parts))


def known_samples(
    configurations: Sensed, states: EpisodeStates, lengths: Lengths = None
) -> Samples:
    """All samples with a known state, in order of time (`forward_samples`)."""
    rows = _known_rows(states, lengths)
    whole = [(episode, slice(None)) for episode in range(len(rows))]
    return _samples_of(configurations, states, rows, whole)


def _samples_of(
    configurations: np.ndarray,
    states: np.ndarray,
    rows: list[np.ndarray],
    part: list[Stretch],
) -> Samples:
    def select(values: np.ndarray) -> np.ndarray:
        parts = [values[episode, rows[episode][span]] for episode, span in part]
        return np.concatenate(parts).astype(np.float32)

    return Samples({"configurations": select(configurations)}, select(states))


def _known_rows(states: np.ndarray, lengths: Lengths) -> list[np.ndarray]:
    """Indices of the samples of each episode with a known state."""
    known = np.isfinite(states).any(axis=(2, 3))
    counts = np.asarray(_lengths_of(states, lengths))
    known &= np.arange(known.shape[1]) < counts[:, None]
    return [np.flatnonzero(mask) for mask in known]


def _lengths_of(values: np.ndarray, lengths: Lengths) -> Sequence[int]:
    return [values.shape[1]] * len(values) if lengths is None else lengths


def controller_samples(
    configurations: Sensed,
    actions: EpisodeActions,
    neutral: Float[np.ndarray, "modules cables"],
    lengths: Lengths = None,
) -> Split:
    """Samples for C2A: C_{t+1}, C_t to C_{t-3}, and A_{t-1} to A_{t-5} in, A_t out.

    Source: Chen et al. 2025, eq. (8). No window crosses the border of an episode or a
    stretch. The arm rests before an episode: the history consists of its first
    configuration and the neutral action, as when a controller starts.
    """
    return history_samples(
        "configurations",
        configurations,
        actions,
        neutral,
        sensed_ages=range(CONFIGURATION_HISTORY),
        action_ages=range(1, ACTION_HISTORY + 1),
        axis=-2,
        lengths=lengths,
    )


def history_samples(
    name: str,
    sensed: Float[np.ndarray, "episodes samples *sensed"],
    actions: EpisodeActions,
    neutral: Float[np.ndarray, "modules cables"],
    *,
    sensed_ages: range,
    action_ages: range,
    axis: int,
    lengths: Lengths = None,
) -> Split:
    """All windows with a complete history and a next sample, the desired one.

    Args:
        name: of the sensed values among the inputs.
        sensed: such as configurations.
        actions: that were sent [m or N].
        neutral: action at rest [m or N].
        sensed_ages: of the sensed values of a window, in control steps.
        action_ages: of its actions.
        axis: of ages.
        lengths: number of samples of each episode, if they differ.
    """
    rest = np.broadcast_to(neutral, (ACTION_HISTORY, *neutral.shape))

    def windows(episode: int, stretch: slice) -> Samples:
        values = sensed[episode, stretch]
        sent = actions[episode, stretch]
        if not stretch.start:
            first = np.repeat(sensed[episode, :1], ACTION_HISTORY, axis=0)
            values = np.concatenate([first, values])
            sent = np.concatenate([rest, sent])
        steps = np.arange(ACTION_HISTORY, len(values) - 1)

        def history(values: np.ndarray, ages: range) -> np.ndarray:
            return np.stack([values[steps - age] for age in ages], axis)

        inputs = {
            "desired": values[steps + 1],
            name: history(values, sensed_ages),
            "actions": history(sent, action_ages),
        }
        return Samples(inputs, sent[steps])

    parts = stretches(_lengths_of(actions, lengths))
    return Split(*(Samples.joined([windows(*each) for each in part]) for part in parts))
