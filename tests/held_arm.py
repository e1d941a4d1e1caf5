"""Actions by share of the full bend, and what an arm does that holds one."""

import numpy as np

from s2c2a.arm import ArmGeometry
from s2c2a.robots.simulation import SimulatedRobot


def action_for(arm, shares) -> np.ndarray:
    """The action that asks for shares of the full bend, shape (modules, cables)."""
    geometry = ArmGeometry.of(arm)
    pulls = np.einsum("mck,mk->mc", geometry.cable_matrices, np.array(shares))
    return geometry.action_neutral + geometry.action_scale[:, None] * pulls


def settled(
    arm, action=None, fidelity="fast", seconds=5.0, push=(0.0, 0.0, 0.0), **options
) -> SimulatedRobot:
    """The robot after holding an action, by default the one at rest, for a while."""
    robot = SimulatedRobot(arm, fidelity, **options)
    robot.open()
    robot.apply_force(push)
    for _ in range(round(seconds * arm.control_rate)):
        robot.step(ArmGeometry.of(arm).action_neutral if action is None else action)
    return robot


def bends(robot) -> np.ndarray:
    """Bend vectors [rad] of all modules, shape (modules, 2)."""
    axes = robot.configurations()
    across = np.linalg.norm(axes[:, :2], axis=-1)
    angles = np.arctan2(across, axes[:, 2])
    return axes[:, :2] * (angles / np.maximum(across, 1e-12))[:, None]
