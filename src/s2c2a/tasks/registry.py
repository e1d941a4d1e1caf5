"""Tasks by name."""

from s2c2a.arm import ArmSpec
from s2c2a.errors import TargetError
from s2c2a.tasks.circle import circle
from s2c2a.tasks.task import Task

TASKS = {"circle": circle}


def task_named(name: str, arm: ArmSpec) -> Task:
    """The task of that name for an arm.

    Raises:
        TargetError: no such task.
    """
    if name not in TASKS:
        raise TargetError(f"no task '{name}'; choose one of {', '.join(TASKS)}")
    return TASKS[name](arm)
