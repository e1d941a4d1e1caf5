"""A robot that carries out commands late: the arm stays near its path."""

from collections import deque

import numpy as np

from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Loop, StepRequest
from s2c2a.spaces import POSITION
from s2c2a.strategies import s2c2a_strategy, shipped_networks
from s2c2a.tasks import circle

SECONDS = 12.0
FAULT_TIME = 4.0  # s
LAG = 3  # control steps
NEAR = 0.05  # m


class LateRobot(SimulatedRobot):
    """Carries out commands some steps late from a moment on."""

    def open(self):
        self.waiting: deque[np.ndarray] = deque(maxlen=LAG + 1)
        return super().open()

    def send(self, action):
        self.waiting.append(np.asarray(action, float))
        late = self.data.time >= FAULT_TIME
        super().send(self.waiting[0] if late else action)
        return action


def test_an_arm_whose_robot_lags_by_three_steps_stays_near_its_path(twin):
    strategy = s2c2a_strategy(shipped_networks(twin))
    goals = circle(twin).goals[: round(SECONDS * twin.control_rate)]
    with Loop(LateRobot(twin), strategy) as loop:
        steps = [loop.tick(StepRequest(goal)) for goal in goals]
    tips = np.array([step.reading["states"][-1, POSITION] for step in steps])
    targets = np.array([goal.desired_positions()[-1] for goal in goals])
    errors = np.linalg.norm(tips - targets, axis=-1)
    settled = errors[round(FAULT_TIME * twin.control_rate) :]
    assert settled.max() < NEAR
    assert settled[-20:].mean() < 0.5 * NEAR
