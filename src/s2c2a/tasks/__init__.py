"""What is asked of an arm."""

from s2c2a.tasks.circle import circle
from s2c2a.tasks.registry import TASKS, task_named
from s2c2a.tasks.task import Task

__all__ = ["TASKS", "Task", "circle", "task_named"]
