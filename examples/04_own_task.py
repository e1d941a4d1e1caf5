"""Define your own task, from code (a figure of eight) and from a waypoint file."""

from pathlib import Path

import numpy as np

import s2c2a
from s2c2a.tasks import Score, load_waypoints, unreachable_waypoints, waypoints_task


def figure_of_eight(arm, seconds=16.0, width=0.3, depth=0.15):
    """One goal for every control step; lengths are multiples of the arm's length."""
    steps = round(seconds * arm.control_rate)
    angle = 2 * np.pi * np.arange(1, steps + 1) / steps
    x = depth * np.sin(2 * angle)
    y = width * np.sin(angle)
    z = 0.97 - 0.7 * (x**2 + y**2)
    # no goal but a small change of configuration
    rest = s2c2a.Goal.of(arm.module_count)
    path = arm.length * np.stack([x, y, z], axis=-1)
    return s2c2a.Task(
        "eight",
        tuple(rest.with_position(point) for point in path),
        (Score("position"), Score("path length")),
    )


def print_scores(task):
    """Run a task on the simulated arm and print its scores."""
    run = s2c2a.run(s2c2a.SimulatedRobot(arm), strategy, task)
    for row in s2c2a.score_run(run, task):
        print(f"{task.name}: {row.score.metric} {row.value:.1f} {row.unit}")


arm = s2c2a.load_arm("twin_arm")
strategy = s2c2a.pcc_strategy(arm)  # constant curvature, which needs no training
print_scores(figure_of_eight(arm))

Path("my_path.csv").write_text(
    "time,x,y,z\n0,0,0,0.6\n2,0.1,0,0.58\n4,0.1,0.1,0.56\n6,0,0,0.7\n"
)
# Units are s and m. Axes and other modules are optional columns.
tracks = load_waypoints("my_path.csv")
for target in unreachable_waypoints(tracks, arm):
    print(f"at {target.time:g} s the target is {100 * target.gap:.0f} cm out of reach")
print_scores(waypoints_task("my_path", tracks, arm))
