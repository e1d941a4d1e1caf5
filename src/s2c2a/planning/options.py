"""How to plan: as the paper does, or by least squares."""

from dataclasses import dataclass
from typing import Literal

from s2c2a.errors import TargetError

MOST_ITERATIONS = 10_000
Guard = Literal["tip", "arm"]
"""What keeps out of obstacles: the tip, as in the paper, or five centre-line points of every module."""


@dataclass(frozen=True)
class PlannerOptions:
    """Adam from the last configuration, as the paper plans (Chen et al. 2025, sec. III-A).

    Attributes:
        learning_rate: of Adam.
        iterations: of Adam in a control step.
        on_sphere: whether each module's vector returns to unit length after every iteration, and stays within the
            module's bend limit. Sensed configurations under sensing coupling are not of unit length.
        guard: what keeps out of obstacles.
    """

    learning_rate: float = 0.02
    iterations: int = 10
    on_sphere: bool = True
    guard: Guard = "tip"

    def __post_init__(self):
        """Refuse what cannot be solved."""
        _check_iterations(self.iterations)
        if not self.learning_rate > 0:
            raise TargetError(f"a learning rate of {self.learning_rate} was asked for; it must be positive")


@dataclass(frozen=True)
class LeastSquaresOptions:
    """Damped least squares on bends.

    Residuals are in units of `unit` for positions and of one for axes, times the root of the goal's weights.

    Attributes:
        iterations: of Levenberg and Marquardt's method in a control step.
        unit: what a length of one stands for, in parts of the arm's length.
        axis: weight of axes beside positions.
        longest_pull: a target further away pulls no more than from there, in parts of the arm's length.
        change: weight of changes of bends [1/rad], times the root of the goal's mu_d.
        evenness: weight of differences between neighbouring modules' bends [1/rad], where a target is asked for: of
            all shapes that serve, take one that the data hold.
        shape: weight of bends that differ from the map's, while the tip goes round obstacles [1/rad].
        limit: weight of bends beyond their limits [1/rad].
        obstacle: weight of points within a threshold and its margin, in `unit`.
        margin: kept around obstacles beyond their thresholds, in parts of the arm's length.
        longest_detour: a way round obstacles that is longer is not taken, in parts of the arm's length; the tip then
            waits before them. With zero none is looked for, and the tip is always drawn straight at its target.
        engaged_slopes: whether slopes are those of taut cables that follow their motors (`ForwardModel.for_planning`),
            or the true ones.
        guard: what keeps out of obstacles.
    """

    iterations: int = 20
    unit: float = 0.4
    axis: float = 1.0
    longest_pull: float = 0.035
    change: float = 0.03
    evenness: float = 0.02
    shape: float = 0.3
    limit: float = 5.0
    obstacle: float = 20.0
    margin: float = 0.04
    longest_detour: float = 0.8
    engaged_slopes: bool = True
    guard: Guard = "tip"

    def __post_init__(self):
        """Refuse what cannot be solved."""
        _check_iterations(self.iterations)
        positive = (self.unit, self.longest_pull)
        weights = (self.axis, self.change, self.evenness, self.shape, self.limit, self.obstacle, self.margin)
        if not (all(value > 0 for value in positive) and all(value >= 0 for value in (*weights, self.longest_detour))):
            raise TargetError(f"{self} asked for; units and pull must be positive, weights and lengths not negative")


AnyPlannerOptions = PlannerOptions | LeastSquaresOptions


def _check_iterations(iterations: int) -> None:
    if not 1 <= iterations <= MOST_ITERATIONS:
        raise TargetError(f"{iterations} iterations were asked for; take 1 to {MOST_ITERATIONS}")
