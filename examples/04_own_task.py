"""A task of your own: a figure of eight with the tip, from code and from a table of waypoints."""

from pathlib import Path

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.evaluation import rollout, score_run
from s2c2a.planning import PAPER, Goal
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import pcc_strategy
from s2c2a.tasks import Score, Task, load_waypoints, out_of_reach, waypoints_task


def figure_of_eight(arm, seconds=16.0, width=0.3, depth=0.15):
    """One goal for every control step; lengths are parts of the arm's, so that any arm can try it."""
    steps = round(seconds * arm.control_rate)
    angle = 2 * np.pi * np.arange(1, steps + 1) / steps
    x = depth * np.sin(2 * angle)
    y = width * np.sin(angle)
    z = 0.97 - 0.7 * (x**2 + y**2)
    rest = Goal.of(arm.module_count)  # asks for nothing but little change
    path = arm.length * np.stack([x, y, z], axis=-1)
    return Task(
        "eight",
        tuple(rest.with_position(point) for point in path),
        (Score("position"), Score("path length")),
    )


def print_scores(task):
    """Drive the simulated arm through a task and print what it is scored by."""
    for one in score_run(
        rollout(SimulatedRobot(arm), strategy, task), task, recipe="paper"
    ):
        print(f"{task.name}: {one.score.metric} {one.value:.1f} {one.unit}")


arm = load_arm("twin_arm")
# plans with constant curvature, so that nothing has to be trained
strategy = pcc_strategy(arm, PAPER)
print_scores(figure_of_eight(arm))

Path("my_path.csv").write_text(
    "time,x,y,z\n0,0,0,0.6\n2,0.1,0,0.58\n4,0.1,0.1,0.56\n6,0,0,0.7\n"
)
# meters and seconds; axes and other modules are further columns
tracks = load_waypoints("my_path.csv")
for far in out_of_reach(tracks, arm):
    print(f"at {far.time:g} s the target is {100 * far.gap:.0f} cm out of reach")
print_scores(waypoints_task("my_path", tracks, arm))
