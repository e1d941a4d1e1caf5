"""Forward model and optimization on constant-curvature arcs [14AMc, 22JL, 23QG].

The forward model is a chain of arcs with the arm's nominal lengths. Each control step,
damped least squares choose the bends whose arcs are nearest to the targets, among those
within the step limit (as Lai et al., arXiv 2106.08250). Depth in obstacles, large bends
and changes of bends add to the cost.
"""

from dataclasses import dataclass

from s2c2a.arm import ArmSpec
from s2c2a.models.forward_model import PCCForwardModel
from s2c2a_experiments.planners.one_step import OneStep


@dataclass(frozen=True)
class ArcsOneStep(OneStep):
    """One step by least squares on ideal arcs."""

    name = "pcc-one-step"

    def model(self, arm: ArmSpec) -> PCCForwardModel:
        """Arcs with the arm's nominal lengths."""
        return PCCForwardModel.of(arm)
