"""From recordings to samples for the two networks, split by stretches of time."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

CONFIGURATION_HISTORY = 4
ACTION_HISTORY = 5
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


def stretches(samples: int) -> list[slice]:
    """Training, validation and test stretch of an episode of so many samples."""
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
) -> Split:
    """Samples for C2A (Chen et al. 2025, eq. (8)): C_{t+1}; C_t to C_{t-3}; A_{t-1} to A_{t-5} in, A_t out.

    No window crosses the border of an episode or a stretch; where history is missing the first value stands in.
    """
    parts = [_windows(configurations[:, part], actions[:, part]) for part in stretches(actions.shape[1])]
    return Split(*parts)


def _windows(configurations: np.ndarray, actions: np.ndarray) -> Samples:
    steps = np.arange(configurations.shape[1] - 1)
    inputs = {
        "wanted": configurations[:, steps + 1],
        "configurations": _history(configurations, steps, range(CONFIGURATION_HISTORY)),
        "actions": _history(actions, steps, range(1, ACTION_HISTORY + 1)),
    }
    return Samples({name: _merge(values) for name, values in inputs.items()}, _merge(actions[:, steps]))


def _history(values: np.ndarray, steps: np.ndarray, ages: range) -> np.ndarray:
    """Values of so many steps ago, youngest first: (episodes, samples, modules, ages, features)."""
    return np.stack([values[:, np.maximum(steps - age, 0)] for age in ages], axis=-2)


def _merge(values: np.ndarray) -> np.ndarray:
    return values.reshape(-1, *values.shape[2:]).astype(np.float32)
