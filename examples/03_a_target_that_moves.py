"""The control loop by hand: trained networks, a moving target and a moving obstacle."""

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.episodes import save_episodes
from s2c2a.planning import Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.runtime import Loop, StepRequest, build_episode
from s2c2a.strategies import s2c2a_strategy, shipped_networks

arm = load_arm("twin_arm")
strategy = s2c2a_strategy(shipped_networks(arm))

steps = []
# On leaving the block the arm goes to rest, and the robot is closed.
with Loop(SimulatedRobot(arm), strategy) as loop:
    for number in range(100):
        time = number * arm.control_period
        target = [0.15 * np.sin(0.5 * time), 0.15 * np.sin(0.25 * time), 0.57]
        obstacle = [0.2, 0.0, 0.45 + 0.01 * time]
        goal = (
            Goal.of(arm.module_count)
            .with_position(target)
            .with_obstacles([obstacle], [0.05])
        )
        step = loop.tick(StepRequest(goal))  # waits for the control period
        if step.fault:
            print(step.fault)
        steps.append(step)

tip = steps[-1].reading["states"][-1, :3]
print(f"the tip is at {tip.round(3)} m, its target was at {np.round(target, 3)} m")
save_episodes([build_episode(steps, arm)], "moving.episodes")
