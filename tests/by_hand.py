"""What second implementations of networks share, in float64."""

import numpy as np


def numbers(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def equation_10(raw):
    squashed = np.tanh(raw)
    return (3 * squashed - squashed.sum(axis=-1, keepdims=True)) / 4


def bend_plane(raw):
    """Four even cables: opposite ones share half their difference, squashed."""
    across = np.stack([raw[:, 2] - raw[:, 0], raw[:, 3] - raw[:, 1]], axis=-1) / 2
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    x, y = (across * np.tanh(length) / length).T
    return np.stack([-x, -y, x, y], axis=-1)
