"""What models learn from."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec


@dataclass(frozen=True)
class TrainingData:
    """Whole episodes of one arm, each begun at rest.

    Attributes:
        arm: the arm.
        sensed: configurations as they were sensed.
        actions: as really sent [m or N].
        states: true ones of the same moments [m, 1], base frame.
    """

    arm: ArmSpec
    sensed: Float[np.ndarray, "episodes samples modules 3"]
    actions: Float[np.ndarray, "episodes samples modules cables"]
    states: Float[np.ndarray, "episodes samples modules 6"]
