"""A task: one goal for every control step, and what its runs are scored by."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.errors import TargetError
from s2c2a.planning import Goal

PAPER_LENGTH = 0.6  # m: lengths of the protocol are for an arm of this length
Path = Float[np.ndarray, "steps 3"]


@dataclass(frozen=True)
class Score:
    """One metric of a task (docs/protocol.md).

    Attributes:
        metric: its name, such as "position".
        module: whose end is scored.
        steps: which steps count; all if None.
    """

    metric: str
    module: int = -1
    steps: Bool[np.ndarray, " steps"] | None = None


@dataclass(frozen=True, eq=False)  # arrays inside know no single answer to ==
class Task:
    """What is asked, step by step; the goal of step t is compared with the state after the action of step t.

    Attributes:
        name: the word a user types.
        goals: one for every control step.
        scores: what a run is scored by.
    """

    name: str
    goals: tuple[Goal, ...]
    scores: tuple[Score, ...] = (Score("position"),)

    def __post_init__(self):
        """Refuse a task that asks for nothing."""
        if not self.goals:
            raise TargetError(
                f"the task '{self.name}' has no goals; give one for every control step"
            )

    @classmethod
    def along(cls, name: str, path: Path, goal: Goal, *scores: Score) -> "Task":
        """The tip along a path [m], base frame, besides what a goal asks for. mu_p = 1."""
        return cls(
            name,
            tuple(goal.with_position(position) for position in path),
            scores or (Score("position"),),
        )

    def with_axes_weighed(self, factor: float) -> "Task":
        """The same task with every mu_o multiplied."""
        goals = (
            goal._replace(axis_weights=np.float32(factor) * goal.axis_weights)
            for goal in self.goals
        )
        return self if factor == 1.0 else replace(self, goals=tuple(goals))

    def desired_positions(self) -> Float[np.ndarray, "steps modules 3"]:
        """Desired module ends [m], base frame; NaN where nothing is asked."""
        return Goal.stacked(self.goals).desired_positions()

    def desired_axes(self) -> Float[np.ndarray, "steps modules 3"]:
        """Desired end axes, base frame; NaN where nothing is asked."""
        return Goal.stacked(self.goals).desired_axes()

    def obstacles(self) -> Float[np.ndarray, "steps obstacles 4"]:
        """Centers and thresholds of the obstacles in use [m], base frame."""
        return Goal.stacked(self.goals).obstacles_in_use()
