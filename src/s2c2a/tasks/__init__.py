"""Tasks: goals for every control step, and scores."""

from s2c2a.tasks.circle import circle
from s2c2a.tasks.lines import to_point
from s2c2a.tasks.registry import TASKS, load_task, paced_task, split_pace
from s2c2a.tasks.scenes import load_scene
from s2c2a.tasks.shapes import load_curve, shape_task
from s2c2a.tasks.task import Score, Task
from s2c2a.tasks.waypoints import (
    OutOfReach,
    Waypoints,
    load_waypoints,
    unreachable_waypoints,
    waypoints_task,
)
