"""Fuzzy logic: rules on the seen errors of the tip, one channel for its axis.

The source is [24JL] of the paper's Table I; the rules are those of Takagi and Sugeno
(IEEE Trans. Systems, Man, and Cybernetics 15, 1985). Errors and their changes along the
axes of the base belong to five triangular sets each; a table of 25 rules gives the motion
that is wanted, to which that of the target is added. The position channel bends the
proximal modules and the orientation channel the distal ones, each along the directions in
which ideal arcs move and against what the other one moves, so that position stays while
orientation changes and the other way round.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import states_from_bends
from s2c2a.planning import Guard
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import AXIS, POSITION
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment

SETS = np.linspace(-1.0, 1.0, 5)
"""Peaks of the triangular sets: large and small negative, zero, small and large
positive."""
RULES = np.clip(SETS[:, None] + 0.5 * SETS, -1.0, 1.0)
"""Output by the sets of the error (rows) and of its change (columns)."""
ROUNDS = 3  # of both channels; each leaves a quarter of what the other one moved
LARGEST_MOTION = 0.05  # arm lengths, and of an axis; targets that move more jump
Vector = Float[np.ndarray, "3"]
BendVector = Float[np.ndarray, " bends"]
Directions = Float[np.ndarray, "3 bends"]
Batch = Float[np.ndarray, "*batch"]
Pair = Float[np.ndarray, "2 3"]
"""Of the tip [arm lengths] and of its axis."""


@dataclass(frozen=True)
class Fuzzy(BendPlanning):
    """Sugeno rules on errors and their changes, with tip feedback.

    Attributes:
        range: of the error, in arm lengths; beyond it, the outermost set holds alone.
        change_range: of its change in a step, in ranges of the error.
        gain: share of the error that a step removes, where no rule saturates.
        axis_range: of the error of the axis.
    """

    range: float = 0.2
    change_range: float = 1.0
    gain: float = 0.1
    axis_range: float = 0.5
    name = "fuzzy"
    sees_states = True
    ignores = frozenset({"other ends", "obstacles"})
    limits: ClassVar[Ranges] = {
        "range": (1e-3, 10.0),
        "change_range": (1e-3, 10.0),
        "gain": (0.0, 1.0),
        "axis_range": (1e-3, 10.0),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "FuzzyRules":
        return FuzzyRules(arm, self)


class _Last(NamedTuple):
    """What the rules were given last."""

    targets: Pair
    errors: Pair


class FuzzyRules:
    """Two channels of rules; the memory is the last errors."""

    def __init__(self, arm: ArmSpec, options: Fuzzy):
        """Compile the directions in which ideal arcs move."""
        lengths = ArmGeometry.of(arm).lengths.astype(np.float32)
        self._options = options
        self._length = arm.length
        count = arm.module_count
        proximal = count - count // 2
        self._proximal = np.arange(2 * count) < 2 * proximal

        def tip_of(bends):
            return states_from_bends(bends, lengths)[-1]

        self._directions = jax.jit(jax.jacfwd(tip_of))
        rest = np.zeros((count, 2), np.float32)
        self._directions(rest)

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""
        self._last: _Last | None = None

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the tip's target; where there is none, the last bends."""
        last = moment.bends
        targets = self._pair(goal.positions[-1], goal.axes[-1])
        has_target = goal.position_weights[-1] > 0.0 and np.isfinite(targets).all()
        if moment.seen is None or not has_target:
            self._last = None
            return last
        tip = moment.seen[-1]
        places = self._pair(tip[POSITION], tip[AXIS])
        if not np.isfinite(places).all():
            return last
        motion = self._motion(targets, targets - places)
        has_axis = goal.axis_weights[-1] > 0.0
        change = self._change(last, motion, has_axis)
        return last + change.reshape(-1, 2)

    def _pair(self, position: Vector, axis: Vector) -> Pair:
        return np.array([position / self._length, axis])

    def _change(self, bends: Bends, motion: Pair, has_axis: bool) -> BendVector:
        """Changes of bends for a motion of the tip, and of its axis if that matters."""
        directions = np.asarray(self._directions(bends))
        directions = directions.reshape(6, -1)
        position = directions[POSITION] / self._length
        if has_axis:
            axis = directions[AXIS]
            if self._proximal.all():
                return _along(position, motion[0])
            # each channel bends against what the other one moves
            by_position = position * self._proximal
            by_axis = axis * ~self._proximal
            change = np.zeros(position.shape[1])
            for _ in range(ROUNDS):
                position_left = motion[0] - position @ change
                change += _along(by_position, position_left)
                axis_left = motion[1] - axis @ change
                change += _along(by_axis, axis_left)
            return change
        return _along(position, motion[0])

    def _motion(self, targets: Pair, errors: Pair) -> Pair:
        """The wanted motion of the tip [arm lengths] and of its axis.

        Rules on the errors, and the motion of the targets, without which the tip would
        stay behind them.
        """
        options = self._options
        now = _Last(targets, errors)
        last = self._last or now
        self._last = now
        ranges = np.array([[options.range], [options.axis_range]])
        change_ranges = options.change_range * ranges
        changes = (errors - last.errors) / change_ranges
        ruled = ranges * sugeno(errors / ranges, changes)
        moved = targets - last.targets
        ways = np.linalg.norm(moved, axis=-1, keepdims=True)
        is_jump = ways > LARGEST_MOTION
        followed = np.where(is_jump, 0.0, moved)
        return options.gain * ruled + followed


def sugeno(error: Batch, change: Batch) -> Batch:
    """Mean of the rules' outputs, weighted by how far both premises hold.

    Args:
        error: in ranges.
        change: of the error in a step, in ranges.
    """
    by_error = memberships(error)[..., :, None]
    by_change = memberships(change)[..., None, :]
    premises = by_error * by_change
    outputs = premises * RULES
    return outputs.sum(axis=(-1, -2))


def memberships(values: Batch) -> Float[np.ndarray, "*batch 5"]:
    """How far values belong to the five sets; their sum is one."""
    inside = np.clip(values, -1.0, 1.0)
    width = SETS[1] - SETS[0]
    distances = np.abs(inside[..., None] - SETS)
    degrees = 1.0 - distances / width
    return np.maximum(degrees, 0.0)


def _along(directions: Directions, motion: Vector) -> BendVector:
    """Changes of bends, each along its direction of motion, scaled by their strength."""
    squares = directions**2
    strength = max(float(squares.sum() / 2.0), 1e-6)
    return directions.T @ motion / strength
