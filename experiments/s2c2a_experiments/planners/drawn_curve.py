"""Drawn curve: the arm lies down along a curve that a user draws.

The source is [18BO] of the paper's Table I, where a user draws the shape and an
optimization fits the arm to it. Here the curve is what a user would draw for a target: a
cubic Bezier curve as long as the arm, from the base along its axis to the target along
its axis. Gauss-Newton steps over all bends, from
those of the last step on, put ends and middles of modules with their tangents on the
curve at their arc lengths; the tip has a larger weight so that it arrives.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import norm, states_from_bends
from s2c2a.planning import Guard
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import AXIS, POSITION
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment

FINE = 64  # intervals of a curve, for its length
HANDLES = 16  # lengths of the curve's handles that are compared
LONGEST_HANDLE = 2.0  # of the arm's length
STEPS = 4  # of Gauss-Newton; the next control step goes on
DAMPING = 1e-3  # of the normal equations, 1/rad2
FREE_TANGENT = 0.5  # of the handle at a target without an axis
UP = jnp.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class DrawnCurve(BendPlanning):
    """Gauss-Newton fit of the arm to a drawn curve.

    Attributes:
        share: of the way to the fit that a step goes.
        tip_weight: of the tip, against the other points.
        tangent_weight: of tangents, in arm lengths.
    """

    share: float = 0.8
    tip_weight: float = 10.0
    tangent_weight: float = 0.05
    name = "drawn-curve"
    ignores = frozenset({"other ends", "obstacles"})
    limits: ClassVar[Ranges] = {
        "share": (0.0, 1.0),
        "tip_weight": (0.0, 1e4),
        "tangent_weight": (0.0, 1e4),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "CurveFollower":
        return CurveFollower(arm, self)


class CurveFollower:
    """Fits the bends to the curve of the moment; its memory is the last fit."""

    def __init__(self, arm: ArmSpec, options: DrawnCurve):
        """Compile for an arm."""
        self._share = options.share
        fit = _CurveFit.of(arm, options)
        self._fit = jax.jit(fit.bends)
        modules = arm.module_count
        upright = [0.0, 0.0, arm.length]
        goal = Goal.of(modules).with_position(upright)
        start = np.zeros((modules, 2), np.float32)
        self._fit(start, *_drawing(goal))

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the curve to the tip's target; where there is none, the last bends."""
        if goal.position_weights[-1] == 0.0:
            return moment.bends
        last = moment.bends
        drawing = _drawing(goal)
        wanted = np.asarray(self._fit(last, *drawing))
        change = wanted - last
        return last + self._share * change


def _drawing(goal: Goal) -> tuple[np.ndarray, ...]:
    """Target [m], its axis, and whether there is one."""
    target = goal.positions[-1]
    axis = goal.axes[-1]
    has_axis = goal.axis_weights[-1] > 0.0
    return target, axis, np.array(has_axis, np.float32)


class _CurveFit(NamedTuple):
    """The fit of one arm to curves.

    Attributes:
        lengths: of the modules [m], shape (modules,).
        limits: of planned bends [rad], shape (modules,).
        options: of the strategy.
    """

    lengths: np.ndarray
    limits: np.ndarray
    options: DrawnCurve

    @classmethod
    def of(cls, arm: ArmSpec, options: DrawnCurve) -> "_CurveFit":
        geometry = ArmGeometry.of(arm)
        lengths = geometry.lengths.astype(np.float32)
        limits = geometry.planned_bends.astype(np.float32)
        return cls(lengths, limits, options)

    @property
    def total(self) -> float:
        """Length of the arm [m]."""
        return float(self.lengths.sum())

    def bends(self, last, target, axis, has_axis):
        """Bends [rad] of the arm along the curve to a target, from the last ones on."""
        points, tangents = self._curve(target, axis, has_axis)

        def residuals(flat):
            bends = flat.reshape(-1, 2)
            return self._residuals(bends, points, tangents)

        jacobian_of = jax.jacfwd(residuals)

        def improve(_, flat):
            jacobian = jacobian_of(flat)
            damping = DAMPING * jnp.eye(len(flat))
            square = jacobian.T @ jacobian + damping
            slope = jacobian.T @ residuals(flat)
            return flat - jnp.linalg.solve(square, slope)

        start = last.reshape(-1)
        flat = jax.lax.fori_loop(0, STEPS, improve, start)
        return flat.reshape(-1, 2)

    def _residuals(self, bends, points, tangents):
        """Without unit: misses in arm lengths, tangents, excess of bends."""
        options = self.options
        states = self._halves(bends)
        weights = jnp.ones((len(states), 1))
        weights = weights.at[-1].set(options.tip_weight)
        misses = states[:, POSITION] - points
        misses = weights * misses / self.total
        turns = states[:, AXIS] - tangents
        turns = options.tangent_weight * turns
        excess = norm(bends) - self.limits
        excess = jnp.maximum(excess, 0.0)
        return jnp.concatenate([misses.ravel(), turns.ravel(), excess])

    def _halves(self, bends) -> Float[Array, "halves 6"]:
        """States of middles and ends of the modules."""
        halves = jnp.repeat(bends / 2.0, 2, axis=0)
        return states_from_bends(halves, self._half_lengths)

    @property
    def _half_lengths(self) -> np.ndarray:
        """From base and ends of the modules to middles, and on to ends [m]."""
        return np.repeat(self.lengths / 2.0, 2)

    def _curve(self, target, axis, has_axis):
        """Points and tangents where middles and ends of the modules belong."""
        free_tangent = FREE_TANGENT * target / self.total
        tangent = jnp.where(has_axis, axis, free_tangent)

        def curve_by(handle):
            first = handle * UP
            second = target - handle * tangent
            return _bezier(first, second, target)

        handle = self._handle(curve_by)
        return self._resampled(curve_by(handle))

    def _handle(self, curve_by):
        """The handle by which a curve is as long as the arm, or nearest to it [m]."""
        shares = jnp.linspace(0.01, LONGEST_HANDLE, HANDLES)
        handles = shares * self.total
        curves = jax.vmap(curve_by)(handles)
        lengths = _lengths(curves)[:, -1]
        excess = lengths - self.total
        cell = _cell_of_root(excess)
        before = excess[cell]
        after = excess[cell + 1]
        rise = after - before
        rise = jnp.where(rise == 0.0, 1.0, rise)
        part = jnp.clip(-before / rise, 0.0, 1.0)
        width = handles[1] - handles[0]
        return handles[cell] + part * width

    def _resampled(self, curve):
        """Points and tangents of a curve at the arc lengths of middles and ends."""
        (along,) = _lengths(curve[None])
        shares = np.cumsum(self._half_lengths) / self.total
        places = shares * along[-1]
        steps = jnp.diff(curve, axis=0)
        sizes = jnp.maximum(norm(steps), 1e-9)
        tangents = steps / sizes[:, None]
        sums = along[1:] + along[:-1]
        middles = sums / 2.0
        interpolate = jax.vmap(jnp.interp, (None, None, 1), 1)
        points = interpolate(places, along, curve)
        return points, interpolate(places, middles, tangents)


def _cell_of_root(values):
    """Number of the first cell in which values cross zero, or of that nearest to it."""
    is_below = values[:-1] < 0.0
    crosses = is_below & (values[1:] >= 0.0)
    nearest = jnp.argmin(jnp.abs(values))
    first = jnp.argmax(crosses)
    cell = jnp.where(crosses.any(), first, nearest)
    last_cell = len(values) - 2
    return jnp.minimum(cell, last_cell)


def _bezier(first, second, target) -> Float[Array, "points 3"]:
    """Points of the cubic Bezier curve from the base to a target."""
    t = jnp.linspace(0.0, 1.0, FINE + 1)[:, None]
    rest = 1.0 - t
    first_weight = 3.0 * t * rest**2
    second_weight = 3.0 * t**2 * rest
    points = first_weight * first
    points = points + second_weight * second
    return points + t**3 * target


def _lengths(curves) -> Float[Array, "curves points"]:
    """Lengths up to the points of curves [m]."""
    steps = jnp.diff(curves, axis=1)
    lengths = jnp.cumsum(norm(steps), axis=1)
    return jnp.pad(lengths, [(0, 0), (1, 0)])
