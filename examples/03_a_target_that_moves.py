"""The control loop by hand: trained networks, a moving target and a moving obstacle."""

import numpy as np

import s2c2a

arm = s2c2a.load_arm("twin_arm")
strategy = s2c2a.load_strategy("shipped", arm)

steps = []
# On leaving the block the arm goes to rest, and the robot is closed.
with s2c2a.Loop(s2c2a.SimulatedRobot(arm), strategy) as loop:
    for number in range(100):
        time = number * arm.control_period
        target = [0.15 * np.sin(0.5 * time), 0.15 * np.sin(0.25 * time), 0.57]
        obstacle = [0.2, 0.0, 0.45 + 0.01 * time]
        goal = (
            s2c2a.Goal.of(arm.module_count)
            .with_position(target)
            .with_obstacles([obstacle], [0.05])
        )
        step = loop.tick(s2c2a.StepRequest(goal))  # waits for the control period
        if step.fault:
            print(step.fault)
        steps.append(step)

tip = steps[-1].reading["states"][-1, :3]
print(f"the tip is at {tip.round(3)} m, its target was at {np.round(target, 3)} m")
s2c2a.save_episodes([s2c2a.build_episode(steps, arm)], "moving.episodes")
