"""What can go wrong, on demand: forces on the body, and sensors that leak and shake."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.live.request import Request
from s2c2a.robots import Robot
from s2c2a.sensing import PAPER_COUPLING
from s2c2a.spaces import Reading

NO_PUSH = (0.0, 0.0, 0.0)


@runtime_checkable
class Disturbable(Protocol):
    """A body that can be pushed and loaded; the simulated arm is one."""

    def push(self, force: Float[np.ndarray, "3"]) -> None:
        """Apply a force at the tip [N], base frame, until the next call."""

    def load(self, payload: float) -> None:
        """Hang a mass at the tip [kg] in place of the last one."""


class Disturbances:
    """What a driver makes go wrong with one body."""

    def __init__(self, robot: Robot):
        """Nothing yet; a body that cannot be pushed is left alone."""
        self._body = robot if isinstance(robot, Disturbable) else None
        self._faults = SensorFaults(robot.arm)
        self._payload, self._push, self._request = 0.0, NO_PUSH, Request()

    def begin(self) -> None:
        """The arm was opened anew, which ends pushes."""
        self._push = NO_PUSH

    def apply(self, request: Request) -> None:
        """Push and load the body as the request says, where that has changed."""
        self._request = request
        if self._body is None:
            return
        if request.payload != self._payload:
            self._body.load(request.payload)
        if request.push != self._push:
            self._body.push(np.array(request.push))
        self._payload, self._push = request.payload, request.push

    def spoilt(self, reading: Reading) -> Reading:
        """A reading with the faults of the latest request."""
        return self._faults.applied(reading, self._request.coupling, self._request.noise)


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
        said = dict(reading.sensors)
        cables, configurations = said.get("cables"), said.get("configurations")
        if coupling and self.couples:
            mixed = (1 - coupling) * np.eye(len(PAPER_COUPLING)) + coupling * np.array(PAPER_COUPLING)
            cables = None if cables is None else self._mixed_cables(cables, mixed)
            configurations = None if configurations is None else mixed @ configurations
        if cables is not None:
            scale = noise * np.abs(self._geometry.action_scale)[:, None]
            said["cables"] = cables + scale * self._random.normal(size=cables.shape)
        if configurations is not None:
            tilt = noise * self._geometry.bend_limits[:, None] * self._random.normal(size=configurations.shape)
            said["configurations"] = _unit(configurations + tilt)
        return Reading(reading.time, said)

    def _mixed_cables(self, cables: np.ndarray, mixed: np.ndarray) -> np.ndarray:
        """Cables of the mixed bends; what the cables have in common stays."""
        geometry = self._geometry
        away = (cables - geometry.action_neutral) / geometry.action_scale[:, None]
        shares = np.einsum("mkc,mc->mk", geometry.bend_matrices, away)
        change = np.einsum("mck,mk->mc", geometry.cable_matrices, mixed @ shares - shares)
        return cables + geometry.action_scale[:, None] * change


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
