"""What can go wrong, on demand: forces on the body, and sensors that leak and shake."""

from dataclasses import replace
from typing import Protocol

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.sensing.estimators import PAPER_COUPLING
from s2c2a.spaces import Reading


class Disturbable(Protocol):
    """A body that can be pushed and loaded; the simulated arm is one."""

    def push(self, force: Float[np.ndarray, "3"]) -> None:
        """Apply a force at the tip [N], base frame, until the next call."""

    def load(self, payload: float) -> None:
        """Hang a mass at the tip [kg] in place of the last one."""


class SensorFaults:
    """Makes readings worse, in the words of the arm's own sensors."""

    def __init__(self, arm: ArmSpec, seed: int = 0):
        """Faults of an arm's sensors; the noise starts from a seed."""
        self._geometry = ArmGeometry.of(arm)
        self._random = np.random.default_rng(seed)
        self.couples = arm.module_count == len(PAPER_COUPLING)

    def applied(self, reading: Reading, coupling: float, noise: float) -> Reading:
        """The reading with its modules' bends mixed (eq. (11) in part), then shaken; the truth beside it as it was.

        Args:
            reading: of the arm.
            coupling: part of the paper's leak, 0 to 1.
            noise: standard deviation in parts of the full range.
        """
        if not coupling and not noise:
            return reading
        cables, configurations = reading.cables, reading.configurations
        if coupling and self.couples:
            mixed = (1 - coupling) * np.eye(len(PAPER_COUPLING)) + coupling * np.array(PAPER_COUPLING)
            cables = self._mixed_cables(cables, mixed)
            configurations = None if configurations is None else mixed @ configurations
        if noise:
            scale = noise * np.abs(self._geometry.action_scale)[:, None]
            cables = cables + scale * self._random.normal(size=cables.shape)
            if configurations is not None:
                tilt = noise * self._geometry.bend_limits[:, None] * self._random.normal(size=configurations.shape)
                configurations = configurations + tilt
        return replace(reading, cables=cables, configurations=_unit(configurations))

    def _mixed_cables(self, cables: np.ndarray, mixed: np.ndarray) -> np.ndarray:
        """Cables of the mixed bends; what the cables have in common stays."""
        geometry = self._geometry
        away = (cables - geometry.action_neutral) / geometry.action_scale[:, None]
        shares = np.einsum("mkc,mc->mk", geometry.bend_matrices, away)
        change = np.einsum("mck,mk->mc", geometry.cable_matrices, mixed @ shares - shares)
        return cables + geometry.action_scale[:, None] * change


def _unit(vectors: np.ndarray | None) -> np.ndarray | None:
    return None if vectors is None else vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
