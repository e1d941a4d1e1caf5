"""Task: one goal for every control step, and the scores of a run."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import TargetError, counted
from s2c2a.goals import MAX_OBSTACLES, Goal, GoalPart, preview_stride, previewed
from s2c2a.runtime.border import check_goal

PAPER_LENGTH = 0.6  # m; lengths of the protocol are for an arm of this length
Path = Float[np.ndarray, "steps 3"]
SOLIDS = tuple(f"obstacle {row} (counted from 0)" for row in range(MAX_OBSTACLES))


@dataclass(frozen=True)
class Score:
    """One metric of a task (docs/results/protocol.md).

    Attributes:
        metric: its name, such as "position".
        module: module whose end is scored; -1 is the tip.
        steps: mask of the steps that count; all if None.
    """

    metric: str
    module: int = -1
    steps: Bool[np.ndarray, " steps"] | None = field(default=None, repr=False)


@dataclass(frozen=True, eq=False)  # == is ambiguous for arrays
class Task:
    """Goals for every control step, and the scores of a run.

    The goal of step t is compared with the state after the action of step t.

    Attributes:
        name: as the user types it.
        goals: one for every control step.
        scores: metrics of a run.
        foreseen: whether the arm knows its goals ahead; not where they come as the arm
            moves, as the target in a hand.
        curve: desired center line from base to tip [m], base frame, which the metric
            `shape` compares; None without one.
        solids: name of the solid of every row of its obstacles, as a scene counts them.
    """

    name: str
    goals: tuple[Goal, ...]
    scores: tuple[Score, ...] = (Score("position"),)
    foreseen: bool = True
    curve: Float[np.ndarray, "points 3"] | None = None
    solids: tuple[str, ...] = SOLIDS

    def __post_init__(self):
        """Validate that there are goals, and nothing else."""
        if not isinstance(self.goals, tuple | list) or not self.goals:
            raise TargetError(
                f"the task '{self.name}' has no goals, got {self.goals!r:.200}; give a "
                "tuple of goals, one for every control step"
            )
        for goal in self.goals:
            Goal.checked(goal)

    def __repr__(self) -> str:
        """Name, size and metrics; the goals are too many to read."""
        metrics = ", ".join(score.metric for score in self.scores)
        return (
            f"<Task {self.name}: {counted(len(self.goals), 'step')}; scores {metrics}>"
        )

    @classmethod
    def along(cls, name: str, path: Path, goal: Goal, *scores: Score) -> "Task":
        """Task that follows a path with the tip, with mu_p = 1.

        Args:
            name: of the task.
            path: tip positions [m], base frame.
            goal: all other targets, the same in every step.
            scores: metrics of a run; the position if none is given.
        """
        goals = tuple(goal.with_position(position) for position in path)
        return cls(name, goals, scores or (Score("position"),))

    @property
    def needs(self) -> frozenset[GoalPart]:
        """Parts of its goals, beside positions of the tip, that are given."""
        return Goal.stacked(self.goals).parts

    def with_scaled_axis_weights(self, factor: float) -> "Task":
        """The same task with all orientation weights mu_o multiplied by a factor."""
        if factor == 1.0:
            return self
        goals = [
            goal._replace(axis_weights=np.float32(factor) * goal.axis_weights)
            for goal in self.goals
        ]
        return replace(self, goals=tuple(goals))

    def check(self, arm: ArmSpec) -> None:
        """Refuse goals that are none for an arm.

        Raises:
            TargetError: see `check_goal`.
        """
        for goal in self.goals:
            check_goal(goal, arm)

    def shown_goals(self, arm: ArmSpec) -> Iterable[Goal]:
        """The goals as an arm gets them, with those ahead if it knows them.

        Raises:
            TargetError: see `check`.
        """
        self.check(arm)
        turn = preview_stride(arm.control_period) * np.deg2rad(arm.step_limit_deg)
        shown = previewed(self.goals, arm.control_period, turn * arm.length)
        return shown if self.foreseen else self.goals

    def desired_positions(self) -> Float[np.ndarray, "steps modules 3"]:
        """Desired module ends [m], base frame; NaN without a target."""
        return np.stack([goal.desired_positions() for goal in self.goals])

    def desired_axes(self) -> Float[np.ndarray, "steps modules 3"]:
        """Desired end axes, base frame; NaN without a target."""
        return Goal.stacked(self.goals).desired_axes()

    def obstacles(self) -> Float[np.ndarray, "steps obstacles 12"]:
        """Active obstacles, as rows (`s2c2a.obstacles`), base frame."""
        return Goal.stacked(self.goals).obstacles_in_use()

    def obstacle_names(self) -> list[str]:
        """Names of these rows; all rows of a mesh have the same."""
        rows = np.flatnonzero(Goal.stacked(self.goals).thresholds.any(axis=0))
        return [self.solids[row] for row in rows]
