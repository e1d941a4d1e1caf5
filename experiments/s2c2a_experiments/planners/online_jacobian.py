"""Online-estimated Jacobian: the tip is seen, and the model is only its last motions.

The Jacobian from bends to the tip starts as that of ideal arcs. Every step, Broyden's
rank-one update makes it agree with the motion that was seen (Broyden, Mathematics of
Computation 19, 1965; Yip and Camarillo, IEEE Trans. Robotics 30, 2014), and the next
bends follow from its damped pseudo-inverse.
"""

from dataclasses import dataclass
from typing import ClassVar

import jax
import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.planning import Guard
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import POSITION
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment

SMALLEST_MOTION = 1e-3  # rad; less is noise


@dataclass(frozen=True)
class OnlineJacobian(BendPlanning):
    """Damped pseudo-inverse of a Jacobian that is updated by what is seen.

    Attributes:
        gain: share of the error that a step removes.
        learning: share of the update that every step applies.
        damping: of the pseudo-inverse, in arm lengths a radian.
    """

    gain: float = 0.3
    learning: float = 0.3
    damping: float = 0.05
    name = "online-jacobian"
    limits: ClassVar[Ranges] = {
        "gain": (0.0, 1.0),
        "learning": (0.0, 1.0),
        "damping": (1e-6, 100.0),
    }
    sees_states = True
    ignores = frozenset({"axes", "other ends", "obstacles"})

    def planner(self, arm: ArmSpec, guard: Guard) -> "Broyden":
        return Broyden(arm, self)


class Broyden:
    """The Jacobian and its last motion."""

    def __init__(self, arm: ArmSpec, options: OnlineJacobian):
        """Begin with the Jacobian of ideal arcs."""
        lengths = ArmGeometry.of(arm).lengths.astype(np.float32)
        self._options = options
        self._length = arm.length

        def tip_of(bends):
            return states_from_bends(bends, lengths)[-1, POSITION]

        self._jacobian_of = jax.jit(jax.jacfwd(tip_of))

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""
        jacobian = np.asarray(self._jacobian_of(moment.bends))
        self._jacobian = jacobian.reshape(3, -1)
        self._last = moment

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the tip's target; where there is none, the last bends."""
        if not np.isfinite(moment.tip).all():
            return moment.bends
        last = self._last
        self._last = moment
        motion = (moment.sensed - last.sensed).reshape(-1)
        tip_motion = moment.tip - last.tip
        squared = motion @ motion
        if squared > SMALLEST_MOTION**2:
            surprise = tip_motion - self._jacobian @ motion
            update = np.outer(surprise, motion)
            share = self._options.learning / squared
            self._jacobian = self._jacobian + share * update
        if goal.position_weights[-1] == 0.0:
            return moment.bends
        options = self._options
        error = goal.positions[-1] - moment.tip
        jacobian = self._jacobian
        damping = options.damping * self._length
        square = jacobian @ jacobian.T
        square = square + damping**2 * np.eye(3)
        multipliers = np.linalg.solve(square, options.gain * error)
        change = jacobian.T @ multipliers
        return moment.bends + change.reshape(-1, 2)
