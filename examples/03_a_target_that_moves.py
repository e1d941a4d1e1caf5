"""Plan online while the target and an obstacle move; nothing compiles in between."""

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.planning import PAPER, Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Loop, StepRequest
from s2c2a.strategies import pcc_strategy

arm = load_arm("twin_arm")
strategy = pcc_strategy(arm, PAPER)

# The loop keeps a real arm's control rate, limits its actions, checks its readings.
with Loop(SimulatedRobot(arm), strategy) as loop:
    for step in range(100):
        time = step * arm.control_period
        target = [0.15 * np.sin(0.5 * time), 0.15 * np.sin(0.25 * time), 0.57]
        obstacle = [0.2, 0.0, 0.45 + 0.01 * time]
        goal = (
            Goal.of(arm.module_count)
            .with_position(target)
            .with_obstacles([obstacle], [0.05])
        )
        tip = loop.tick(StepRequest(goal)).reading["states"][-1, :3]
    print(f"the tip is at {tip.round(3)} m, its target was at {np.round(target, 3)} m")
