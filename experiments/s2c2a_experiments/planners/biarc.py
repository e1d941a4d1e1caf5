"""Bi-arc: the arm as two circular arcs, whose bends follow in closed form.

The source is [22ZM] of the paper's Table I, inverse kinematics by bi-arcs; the bi-arc is
that of Bolton (Computer-Aided Design 7, 1975). A curve of two arcs leaves the base along
its axis and ends at the target, with its axis if there is one; the parameter that is free
is found where the curve is as long as the arm. Integrals of its curvature over the
modules are their bends. Without an axis the arcs meet at the end of a module, so that the
bends are exact; with one, the target is shifted by what the modules miss.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.goals import Goal
from s2c2a.kinematics import bends_from_configurations, norm, states_from_bends
from s2c2a.kinematics.bends import Scalar, sinc
from s2c2a.kinematics.chain import rotations_to
from s2c2a.planning import Guard
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import POSITION
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment

CELLS = 48  # of the free parameter, between which the length is compared
HALVINGS = 10  # of such a cell: 1e-4 rad, or 2e-5 of the arm's length
AXES = 13  # from the desired axis to that of the curve without one
SHIFTS = 3  # of the target by what the modules miss
WIDEST = 0.75 * np.pi  # rad; half the angle of an arc: more is a loop
NEVER = 1e6  # cost of a curve of another length
CLOSE = 1e-3  # of the arm's length; a curve that differs by less is as long
BEYOND = 100.0  # cost of a radian beyond the limits
UP = jnp.array([0.0, 0.0, 1.0])
SIDE = jnp.array([1.0, 0.0])
Point = Float[Array, "3"]
ArmBends = Float[Array, "modules 2"]
CurveBends = Float[Array, "curves modules 2"]
Costs = Float[Array, " curves"]
EndAxes = Float[Array, "axes 3"]
Cells = Float[Array, "rows cells"]
"""Of a free parameter; every row has its own root."""
CellVectors = Float[Array, "rows cells 3"]


@dataclass(frozen=True)
class BiArc(BendPlanning):
    """Two arcs from base to target, as long as the arm.

    Attributes:
        share: of the way to the bends of the curve that a step goes.
        axis_weight: cost of a radian between the axis and the desired one, against that
            of bends.
        change_weight: cost of a change of bends, against that of bends.
    """

    share: float = 0.8
    axis_weight: float = 10.0
    change_weight: float = 1.0
    name = "biarc"
    ignores = frozenset({"other ends", "obstacles"})
    limits: ClassVar[Ranges] = {
        "share": (0.0, 1.0),
        "axis_weight": (0.0, 1e4),
        "change_weight": (0.0, 1e4),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "BiArcPlanner":
        return BiArcPlanner(arm, self)


class BiArcPlanner:
    """Goes to the bends of the best curve of two arcs; it has no memory."""

    def __init__(self, arm: ArmSpec, options: BiArc):
        """Compile for an arm."""
        self._share = options.share
        curves = _Curves.of(arm, options)
        self._free = jax.jit(curves.free)
        self._bound = jax.jit(curves.bound)
        shape = arm.module_count, 2
        start = np.zeros(shape, np.float32)
        target = np.full(3, arm.length / 2, np.float32)
        self._free(target, start)
        self._bound(target, target, start)

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest."""

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Toward the curve to the tip's target; where there is none, the last bends."""
        if goal.position_weights[-1] == 0.0:
            return moment.bends
        last = moment.bends
        target = goal.positions[-1]
        has_axis = goal.axis_weights[-1] > 0.0
        if has_axis:
            wanted = self._bound(target, goal.axes[-1], last)
        else:
            wanted = self._free(target, last)
        change = np.asarray(wanted) - last
        return last + self._share * change


class _Arcs(NamedTuple):
    """Curves of two arcs, any number of them.

    Attributes:
        joint: length of the first arc [m].
        excess: length of the curve beyond that of the arm [m].
        first: bend of the first arc [rad], base frame.
        second: bend of the second arc [rad], frame of the joint.
        axis: at the end.
    """

    joint: Float[Array, "*curves"]
    excess: Float[Array, "*curves"]
    first: Float[Array, "*curves 2"]
    second: Float[Array, "*curves 2"]
    axis: Float[Array, "*curves 3"]


class _Curves(NamedTuple):
    """Curves of two arcs for one arm.

    Attributes:
        lengths: of the modules [m], shape (modules,).
        limits: of planned bends [rad], shape (modules,).
        options: of the strategy.
    """

    lengths: np.ndarray
    limits: np.ndarray
    options: BiArc

    @classmethod
    def of(cls, arm: ArmSpec, options: BiArc) -> "_Curves":
        geometry = ArmGeometry.of(arm)
        lengths = geometry.lengths.astype(np.float32)
        limits = geometry.planned_bends.astype(np.float32)
        return cls(lengths, limits, options)

    def free(self, target: Point, last: ArmBends) -> ArmBends:
        """Bends of the modules [rad] whose tip is at the target."""
        arcs = self._planar(target, last)
        bends, _ = self._best(arcs, last)
        return bends

    def bound(self, target: Point, axis: Point, last: ArmBends) -> ArmBends:
        """Bends of the modules [rad] whose tip is at the target, along an axis."""
        planar = self._planar(target, last)
        without, free_axis = self._best(planar, last)
        # axes from the desired one to the free one
        shares = jnp.linspace(0.0, 1.0, AXES)[:, None]
        change = free_axis - axis
        ways = axis + shares * change
        sizes = norm(ways)
        axes = ways / sizes[:, None]

        def best(aim):
            arcs = self._spatial(aim, axes)
            cosine = jnp.clip(arcs.axis @ axis, -1.0, 1.0)
            off = jnp.arccos(cosine)
            cost = self.options.axis_weight * off
            bends, _ = self._best(arcs, last, cost)
            is_finite = jnp.isfinite(bends).all()
            return jnp.where(is_finite, bends, without)

        def shift(_, aim):
            states = states_from_bends(best(aim), self.lengths)
            tip = states[-1, POSITION]
            return aim + target - tip

        aim = jax.lax.fori_loop(0, SHIFTS, shift, target)
        return best(aim)

    @property
    def total(self) -> float:
        """Length of the arm [m]."""
        return float(self.lengths.sum())

    @property
    def joints(self) -> np.ndarray:
        """Where the arcs may meet if the axis is free [m]."""
        ends = np.cumsum(self.lengths)
        if len(ends) == 1:
            return ends / 2.0
        return ends[:-1]

    def _best(
        self, arcs: _Arcs, last: ArmBends, cost: Costs | float = 0.0
    ) -> tuple[ArmBends, Point]:
        """Bends [rad] and end axis of the curve of least cost."""
        bends = self._modules(arcs)
        cost = cost + self._bend_costs(bends, last)
        # none for curves as long as the arm
        miss = jnp.abs(arcs.excess) / self.total
        never = NEVER * (1.0 + miss)
        length_costs = jnp.where(miss < CLOSE, 0.0, never)
        cost = cost + length_costs
        is_finite = jnp.isfinite(cost)
        cost = jnp.where(is_finite, cost, jnp.inf)
        best = jnp.argmin(cost)
        return bends[best], arcs.axis[best]

    def _bend_costs(self, bends: CurveBends, last: ArmBends) -> Costs:
        """Of bends, of what they are beyond their limits, and of their changes."""
        excess = norm(bends) - self.limits
        beyond = jnp.maximum(excess, 0.0).sum(axis=-1)
        cost = _squares(bends) + BEYOND * beyond
        change = _squares(bends - last)
        return cost + self.options.change_weight * change

    def _modules(self, arcs: _Arcs) -> CurveBends:
        """Integrals of the curvature over the modules [rad]."""
        ends = np.cumsum(self.lengths)
        total = ends[-1]
        shortest = 1e-6 * total
        longest = (1.0 - 1e-6) * total
        joint = jnp.clip(arcs.joint, shortest, longest)
        joint = joint[:, None]
        before = joint - ends + self.lengths
        first = jnp.clip(before, 0.0, self.lengths)
        second = self.lengths - first
        first_share = first / joint
        second_share = second / (total - joint)
        first_bends = first_share[..., None] * arcs.first[:, None]
        second_bends = second_share[..., None] * arcs.second[:, None]
        return first_bends + second_bends

    def _planar(self, target: Point, last: ArmBends) -> _Arcs:
        """Curves in the plane of base axis and target that meet at ends of modules."""
        direction = self._direction(target, last)
        aside = target[:2] @ direction
        joints = self.joints[:, None]
        second = partial(self._second_turn, aside, target[2])

        def excess_of(half):
            _, excess = second(half)
            return excess

        half = _root(excess_of, -WIDEST, WIDEST, len(joints))
        turn, excess = second(half)
        angle = 2.0 * (half + turn)[..., None]
        sideways = jnp.sin(angle) * direction
        axis = jnp.concatenate([sideways, jnp.cos(angle)], axis=-1)
        first_bends = 2.0 * half[..., None] * direction
        second_bends = 2.0 * turn[..., None] * direction
        joint = jnp.broadcast_to(joints, half.shape)
        return _Arcs(
            _in_a_row(joint),
            _in_a_row(excess),
            _rows(first_bends),
            _rows(second_bends),
            _rows(axis),
        )

    def _direction(self, target: Point, last: ArmBends) -> Float[Array, "2"]:
        """Unit vector from the base axis to the target, or as the arm is bent."""
        lateral = target[:2]
        bend = last.sum(axis=0)
        is_bent = norm(bend) > 0.0
        bent = jnp.where(is_bent, bend, SIDE)
        distance = norm(lateral)
        is_aside = distance > 1e-4 * self.total
        direction = jnp.where(is_aside, lateral, bent)
        return direction / norm(direction)

    def _second_turn(
        self, aside: Scalar, above: Scalar, half: Cells
    ) -> tuple[Cells, Cells]:
        """Half the second arc's angle [rad], and the excess of the curve [m].

        Args:
            aside: place of the target beside the base axis [m].
            above: and along it [m].
            half: of the first arc's angle [rad].
        """
        joints = self.joints[:, None]
        chord = joints * sinc(half**2)
        left = aside - chord * jnp.sin(half)
        up = above - chord * jnp.cos(half)
        slant = jnp.arctan2(left, up)
        turn = slant - 2.0 * half
        turn = jnp.arctan2(jnp.sin(turn), jnp.cos(turn))
        shortening = sinc(turn**2)
        shortening = jnp.maximum(shortening, 1e-3)
        length = jnp.hypot(left, up) / shortening
        return turn, length + joints - self.total

    def _spatial(self, target: Point, axes: EndAxes) -> _Arcs:
        """Curves that end along axes."""
        arcs = partial(self._tangent_arcs, target, axes)

        def excess_of(first):
            _, excess, _ = arcs(first)
            return excess

        tangent = _root(excess_of, 0.0, self.total, len(axes))
        joint, excess, middle = arcs(tangent)
        first_bends = bends_from_configurations(middle)
        local = jnp.einsum("acji,aj->aci", rotations_to(middle), axes)
        second_bends = bends_from_configurations(local)
        ends = jnp.broadcast_to(axes[:, None], middle.shape)
        return _Arcs(
            _in_a_row(joint),
            _in_a_row(excess),
            _rows(first_bends),
            _rows(second_bends),
            _rows(ends),
        )

    def _tangent_arcs(
        self, target: Point, axes: EndAxes, first: Cells
    ) -> tuple[Cells, Cells, CellVectors]:
        """Length of the first arc, excess of the curve [m], and axis at the joint.

        Args:
            target: [m].
            axes: at the end.
            first: length of the first arc's tangents [m].
        """
        ends = axes[:, None]
        # length of the second arc's tangents that join those of the first [m]
        half_square = target @ target / 2.0
        chord = half_square - first * target[2]
        along = axes @ target
        tilts = 1.0 - axes[:, 2:]
        slope = along[:, None] + first * tilts
        is_flat = jnp.abs(slope) < 1e-9
        slope = jnp.where(is_flat, 1e-9, slope)
        second = chord / slope
        upward = first[..., None] * UP
        onward = second[..., None] * ends
        way = target - upward - onward
        both = first + second
        middle = way / both[..., None]
        first_length = _arc(first, UP, middle)
        second_length = _arc(second, middle, ends)
        whole = first_length + second_length
        whole = jnp.where(second > 0.0, whole, jnp.nan)
        return first_length, whole - self.total, middle


def _root(
    function: Callable[[Cells], Cells], low: float, high: float, count: int
) -> Cells:
    """Where a function is zero in cells of rows, or where it is nearest to it.

    Args:
        function: of all cells at once.
        low: where the cells begin.
        high: where they end.
        count: number of rows.
    """
    edges = jnp.linspace(low, high, CELLS + 1)
    rows = jnp.tile(edges, (count, 1))
    before = rows[:, :-1]
    after = rows[:, 1:]
    values = function(rows)[:, :-1]
    sign = jnp.sign(values)

    def halve(_, cell):
        left, right = cell
        middle = (left + right) / 2.0
        value = function(middle)
        is_right = value * sign > 0.0
        left = jnp.where(is_right, middle, left)
        right = jnp.where(is_right, right, middle)
        return left, right

    left, right = jax.lax.fori_loop(0, HALVINGS, halve, (before, after))
    return (left + right) / 2.0


def _arc(
    tangent: Cells, start: Float[Array, "*cells 3"], end: Float[Array, "*cells 3"]
) -> Cells:
    """Length of an arc between two axes whose tangents are so long [m]."""
    cosine = (start * end).sum(axis=-1)
    cosine = jnp.clip(cosine, -1.0, 1.0)
    half = jnp.arccos(cosine) / 2.0
    ratio = half / jnp.tan(half)
    ratio = jnp.where(half < 1e-3, 1.0, ratio)
    return 2.0 * tangent * ratio


def _squares(bends: Float[Array, "*curves modules 2"]) -> Float[Array, "*curves"]:
    """Sum of squares over the modules [rad2]."""
    squares = bends**2
    return squares.sum(axis=(-1, -2))


def _in_a_row(values: Float[Array, "..."]) -> Float[Array, " values"]:
    return values.reshape(-1)


def _rows(values: Float[Array, "... width"]) -> Float[Array, "rows width"]:
    return values.reshape(-1, values.shape[-1])
