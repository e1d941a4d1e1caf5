"""Projection: targets that an arm does not reach are moved to where it does."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool

from s2c2a.goals import Goal
from s2c2a.planning.reach import Reachability, Reached
from s2c2a.spaces import AXIS, POSITION
from s2c2a.tasks.task import Task


class Projection(NamedTuple):
    """A task within reach.

    Attributes:
        task: with the targets that are missed moved to the nearest that are reached.
        is_moved: steps whose targets are moved.
        reached: the nearest shapes to all targets; None without any.
    """

    task: Task
    is_moved: Bool[np.ndarray, " steps"]
    reached: Reached | None


def projected(task: Task, length: float, reachability: Reachability) -> Projection:
    """The task within reach of an arm at rest.

    Steps without a target stay as they are.

    Args:
        task: any.
        length: of the arm [m].
        reachability: of the arm, with its guard and payload.
    """
    goals = Goal.stacked(task.goals)
    numbers = np.flatnonzero(goals.has_target)
    is_moved = np.zeros(len(task.goals), bool)
    if not len(numbers):
        return Projection(task, is_moved, None)
    values = [np.reshape(field[numbers], (len(numbers), -1)) for field in goals]
    rows = np.nan_to_num(np.concatenate(values, axis=1))  # NaN differs from NaN
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    aimed = Goal(*(field[numbers[first]] for field in goals))
    found = reachability.nearest(aimed)
    reached = Reached(*(field[which] for field in found))
    is_missed = ~reached.within(length)
    is_moved[numbers] = is_missed
    changed = list(task.goals)
    for row in np.flatnonzero(is_missed):
        states = np.asarray(reached.states[row], np.float32)
        near = {"positions": states[:, POSITION], "axes": states[:, AXIS]}
        changed[numbers[row]] = task.goals[numbers[row]]._replace(**near).frozen()
    return Projection(replace(task, goals=tuple(changed)), is_moved, reached)
