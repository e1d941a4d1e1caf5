"""A simulated robot and a tracker of it in simulated time, with noise and latency."""

from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation

from s2c2a.lab.tracking import Pose, PoseFrame, Tracker
from s2c2a.robots.simulation import SimulatedRobot

STEPS = 2  # of physics between exposures
RATE = 100.0  # Hz; of the frames


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
        turns = self.data.site_xmat[self.end_sites].reshape(-1, 3, 3)
        rotations = Rotation.from_matrix(turns).as_quat()
        return list(map(Pose, self.data.site_xpos[self.end_sites], rotations))


class SimulatedTracker(Tracker):
    """Frames of a simulated robot, whose base body is mounted with an offset."""

    def __init__(self, robot, latency=0.0, noise=0.0, base=None):
        self._robot = robot
        # physics reads a command one step before the encoders do: in a step of length
        # h, q(t + h) - 2 q(t) + q(t - h) follows the command of t + h
        self._delay = latency + robot.model.opt.timestep
        self._noise = noise
        self._every = round(1 / RATE / robot.model.opt.timestep / STEPS)
        self._base = (base or Pose.identity()).inverse()
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
        bodies = {"base": self._base}
        bodies |= {f"end-{number}": pose for number, pose in enumerate(poses, 1)}
        noisy = {name: self._with_noise(pose) for name, pose in bodies.items()}
        return PoseFrame(exposure + self._delay, exposure, self._number, noisy)

    def _with_noise(self, pose):
        noise = self._random.normal(0.0, self._noise, 3)
        return Pose(pose.position + noise, pose.rotation)
