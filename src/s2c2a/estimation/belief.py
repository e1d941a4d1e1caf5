"""What an observer believes of its arm."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Float

from s2c2a.models.disturbances import Disturbances


class Belief(NamedTuple):
    """What is believed of an arm.

    Attributes:
        mean: load [kg], leans [rad], bends [rad], their rates [rad/s], zeros of sensors
            [theirs]; shape (1 + 3 n + zeros,) with n = 2 modules.
        covariance: of it.
        calming: bends asked for beside the plan, against the swing [rad], shape
            (modules, 2).
        rests: at which the plan would rest, of the last step [rad], shape (modules, 2).
        before: bends of the last steps [rad] (`sensors.Shape`), the newest first, shape
            (steps, modules, 2).
        states_before: there, of the same steps, shape (steps, modules, 6).
        found_before: what was known of bends at rest beside what encoders tell, of the
            same steps [rad], shape (steps, modules, 2).
        lagging: what each sense keeps in mind of where the arm was (`Sense.lagging`).
        strange: how strange each sense was of late, in standard deviations, shape
            (sensors,).
        rejected: seconds for which each is left out from now on, shape (sensors,).
    """

    mean: Float[Array, " states"]
    covariance: Float[Array, "states states"]
    calming: Float[Array, "modules 2"]
    rests: Float[Array, "modules 2"]
    before: Float[Array, "steps modules 2"]
    states_before: Float[Array, "steps modules 6"]
    found_before: Float[Array, "steps modules 2"]
    lagging: tuple[Array | np.ndarray, ...]
    strange: Float[Array, " sensors"]
    rejected: Float[Array, " sensors"]

    @property
    def disturbances(self) -> Disturbances:
        """What a forward model is told."""
        bends = self.calming.size
        return Disturbances(self.mean[0], self.mean[1 : 1 + bends].reshape(-1, 2))
