"""A robot of your own: ideal arcs that follow commands with a lag, in real time.

    s2c2a robot check --robot own_robot.py:LaggingArm --robot-option lag=0.05
    s2c2a collect --robot own_robot.py:LaggingArm --out own.episodes

Then train, and pass the same `--robot` to `run` and `live`.
"""

import time

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.robots import Robot, checked_action
from s2c2a.spaces import Reading, Sensor


class LaggingArm(Robot):
    """PCC arm whose cables follow commands with a first-order lag [s]."""

    def __init__(self, arm: ArmSpec, lag: float = 0.05, seed: int = 0):
        self.arm = arm
        self._geometry = ArmGeometry.of(arm)
        self._lag = lag  # [s]
        self._random = np.random.default_rng(seed)
        self._begun = self._sent_at = time.perf_counter()
        self._command = self._start = self._geometry.action_neutral

    @property
    def sensors(self):
        # plausible readings exceed the limits by this margin
        margin = 0.1 * np.abs(self._geometry.action_scale)[:, None]
        low = self._geometry.action_low - margin
        high = self._geometry.action_high + margin
        return {
            "cables": Sensor(low.shape, "m", low, high),
            "states": Sensor((self.arm.module_count, 6), "m, 1"),
        }

    def open(self) -> Reading:
        self._begun = self._sent_at = time.perf_counter()
        self._command = self._start = self._geometry.action_neutral
        return self.read()

    def read(self) -> Reading:
        noise = self._random.normal(scale=1e-5, size=self._command.shape)
        return Reading(
            time.perf_counter() - self._begun,
            {"cables": self._cables() + noise, "states": self._states()},
        )

    def send(self, action):
        self._start = self._cables()
        self._command = checked_action(action, self._geometry)
        self._sent_at = time.perf_counter()
        return self._command.copy()

    def close(self) -> None:
        pass  # a real arm disables its motors here and opens its bus in `open`

    def _cables(self):
        remaining = np.exp(-(time.perf_counter() - self._sent_at) / self._lag)
        return self._command + remaining * (self._start - self._command)

    def _states(self):
        """States of constant-curvature arcs, as motion capture measures them."""
        displacements = self._cables() / self._geometry.cable_radii[:, None]
        turn = Rotation.identity()
        end = 0.0
        states = []
        for length, bend in zip(
            self._geometry.lengths,
            self._geometry.bend_matrices @ displacements[..., None],
            strict=True,
        ):
            (x, y) = bend[:, 0]
            angle = np.linalg.norm(bend)
            along = np.sinc(angle / np.pi)
            across = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
            end = end + turn.apply(length * np.array([across * x, across * y, along]))
            turn = turn * Rotation.from_rotvec([-y, x, 0.0])
            states.append([*end, *turn.apply([0.0, 0.0, 1.0])])
        return np.array(states)
