"""A task of your own, in one file: a figure of eight with the tip, slower in the middle.

    s2c2a run examples/extending/own_task.py:figure_of_eight --strategy pcc

A task is a function that takes an arm and returns a Task. Name it as file.py:function,
as module:function, or by an entry point `s2c2a.tasks` of your package.
"""

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.goals import Goal
from s2c2a.tasks import Score, Task

SECONDS = 16.0
# shares of the arm's length
WIDTH = 0.3
DEPTH = 0.15
HEIGHT = 0.97


def figure_of_eight(arm: ArmSpec) -> Task:
    """One goal for each control step; scored with and without the first second."""
    steps = round(SECONDS * arm.control_rate)
    phase = np.arange(1, steps + 1) / steps
    angle = 2 * np.pi * phase - 0.3 * np.sin(4 * np.pi * phase)
    x = DEPTH * np.sin(2 * angle)
    y = WIDTH * np.sin(angle)
    # [m], base frame
    path = arm.length * np.stack([x, y, HEIGHT - 0.7 * (x**2 + y**2)], axis=-1)
    empty = Goal.of(arm.module_count)
    goals = tuple(empty.with_position(point) for point in path)
    counted = np.arange(steps) >= arm.control_rate
    return Task(
        "eight", goals, (Score("position", steps=counted), Score("path length"))
    )
