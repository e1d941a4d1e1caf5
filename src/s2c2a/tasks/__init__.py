"""Tasks: goals for every control step, and scores."""

from s2c2a.tasks.circle import circle, tilt
from s2c2a.tasks.registry import TASKS, task_named
from s2c2a.tasks.task import Score, Task
from s2c2a.tasks.waypoints import (
    Waypoints,
    load_waypoints,
    out_of_reach,
    waypoints_task,
)
