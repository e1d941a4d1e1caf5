"""Actions by share of the full bend, and the bends that an arm has."""

import numpy as np

from s2c2a.arm import ArmGeometry


def action_for(arm, shares) -> np.ndarray:
    """The action that asks for shares of the full bend, shape (modules, cables)."""
    geometry = ArmGeometry.of(arm)
    pulls = np.einsum("mck,mk->mc", geometry.cable_matrices, np.array(shares))
    return geometry.action_neutral + geometry.action_scale[:, None] * pulls


def bends(robot) -> np.ndarray:
    """Bend vectors [rad] of all modules, shape (modules, 2)."""
    axes = robot.configurations()
    across = np.linalg.norm(axes[:, :2], axis=-1)
    angles = np.arctan2(across, axes[:, 2])
    return axes[:, :2] * (angles / np.maximum(across, 1e-12))[:, None]
