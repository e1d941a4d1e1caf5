"""No planner: the arm keeps its bends. What it achieves, a task gives for nothing."""

from dataclasses import dataclass

from s2c2a.arm import ArmSpec
from s2c2a.goals import Goal
from s2c2a.planning import Guard
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment


@dataclass(frozen=True)
class Still(BendPlanning):
    """The bends of the start, whatever the goals."""

    name = "still"
    ignores = frozenset({"axes", "other ends", "obstacles"})

    def planner(self, arm: ArmSpec, guard: Guard) -> "SameBends":
        return SameBends()


class SameBends:
    """The last bends once more."""

    def start(self, moment: Moment) -> None:
        """Nothing to remember."""

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """The last bends."""
        return moment.bends
