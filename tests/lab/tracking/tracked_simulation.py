"""A simulated robot and a tracker of it in simulated time, with noise and latency."""

from collections import deque

import mujoco
import numpy as np

from s2c2a.lab.tracking import Pose, PoseFrame, Tracker
from s2c2a.robots.simulation import SimulatedRobot

STEPS = 2  # of physics between exposures


class TrackedSimulation(SimulatedRobot):
    """Notes the poses of the module ends at every other physics step."""

    def __init__(self, arm, **options):
        self.exposures = deque(maxlen=200)
        self.steps = 0
        super().__init__(arm, **options)

    def open(self):
        reading = super().open()
        self.exposures.clear()  # of settling, on another clock
        return reading

    def advance(self, seconds):
        step = self.model.opt.timestep
        for _ in range(max(1, round(seconds / step))):
            super().advance(step)
            self.steps += 1
            if self.steps % STEPS == 0:
                self.exposures.append((self.data.time, self.end_poses()))

    def end_poses(self):
        return [self._pose(site) for site in self.end_sites]

    def _pose(self, site):
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, self.data.site_xmat[site])
        return Pose(self.data.site_xpos[site].copy(), np.roll(quaternion, -1))


class SimulatedTracker(Tracker):
    """Frames of a simulated robot, whose bodies are mounted with offsets."""

    def __init__(
        self,
        robot,
        latency=0.0,
        noise=0.0,
        rate=100.0,
        world=None,
        base=None,
        ends=None,
        rename=None,
    ):
        identity = Pose.identity()
        self._robot = robot
        # physics reads a command one step before the encoders do: in a step of length
        # h, q(t + h) - 2 q(t) + q(t - h) follows the command of t + h
        self._delay = latency + robot.model.opt.timestep
        self._noise = noise
        self._every = max(1, round(1 / rate / robot.model.opt.timestep / STEPS))
        self._world = world or identity
        self._base = (base or identity).inverse()
        self._ends = [end.inverse() for end in ends or []] or [
            identity for _ in range(robot.arm.module_count)
        ]
        self._rename = rename or {}
        self._random = np.random.default_rng(3)
        self._number = 0
        self._latest = None

    def start(self):
        self._latest = self._make_frame(0.0, self._robot.end_poses())

    def latest(self):
        exposures = self._robot.exposures
        while exposures and exposures[0][0] + self._delay <= self._robot.data.time:
            exposure, poses = exposures.popleft()
            self._number += 1
            if self._number % self._every == 0:
                self._latest = self._make_frame(exposure, poses)
                break
        return self._latest

    def close(self):
        self._robot.exposures.clear()

    def _make_frame(self, exposure, poses):
        bodies = {"base": self._world @ self._base}
        for number, (pose, offset) in enumerate(zip(poses, self._ends, strict=True), 1):
            bodies[f"end-{number}"] = self._world @ pose @ offset
        noisy = {
            self._rename.get(name, name): self._with_noise(pose)
            for name, pose in bodies.items()
        }
        return PoseFrame(exposure + self._delay, exposure, self._number, noisy)

    def _with_noise(self, pose):
        noise = self._random.normal(0.0, self._noise, 3)
        return Pose(pose.position + noise, pose.rotation)
