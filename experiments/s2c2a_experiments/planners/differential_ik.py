"""Differential inverse kinematics: tasks and limits in one quadratic program.

It is what Pink and mink do for rigid robots (Kanoun et al., IEEE Trans. Robotics 27,
2011), on ideal arcs. Each control step, the change of bends minimizes the squared errors
of all tasks to first order: module ends, end axes, their motion, and even bends. Bend and
step limits are linear inequalities, and so are control barriers: the clearance d of a
guarded point from an obstacle falls by at most a share of d.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.arm.geometry import directions_at
from s2c2a.execution.compilation import compiled
from s2c2a.goals import Goal
from s2c2a.integrations.extras import needs_extra
from s2c2a.kinematics import commanded_part, states_from_bends
from s2c2a.planning.terms import Guard, GuardedPoints
from s2c2a.plugins.components import Ranges
from s2c2a.spaces import POSITION
from s2c2a_experiments.planners.arc_driver import BendPlanning, Bends, Moment
from s2c2a_experiments.planners.nearby import Nearby, States

SIDES = 8  # of the polygon in the disc of bends; it is at most 8 % smaller
OBSTACLES = 8  # nearest; chosen: more rarely bound a step
BARRIERS = 24  # nearest pairs of a guarded point and an obstacle; chosen likewise
POSTURE = 1e-3  # of even bends, as the damping; chosen: moves the tip by 1 mm at most
SOFT = 8  # flag of DAQP: a constraint that it breaks where none holds all of them

Matrix = Float[np.ndarray, "rows bends"]
Vector = Float[np.ndarray, " rows"]
Targets = Float[np.ndarray, "modules 6"]
FlatBends = Float[Array, " bends"]


@dataclass(frozen=True)
class DifferentialIK(BendPlanning):
    """Quadratic program of tasks, limits and barriers.

    Attributes:
        gain: share of the errors that a step removes.
        axis_weight: of axes beside positions, which are in parts of the arm's length.
        damping: of the change of bends, squared parts of the arm's length a radian.
        barrier_gain: share of its clearance that a guarded point may lose in a step.
    """

    gain: float = 0.3
    axis_weight: float = 0.5
    damping: float = 0.01
    barrier_gain: float = 0.3
    name = "diff-ik"
    supports = frozenset({"guard"})
    limits: ClassVar[Ranges] = {
        "gain": (0.0, 1.0),
        "axis_weight": (0.0, 100.0),
        "damping": (1e-9, 100.0),
        "barrier_gain": (0.0, 1.0),
    }

    def planner(self, arm: ArmSpec, guard: Guard) -> "ProgramPlanner":
        guarded = GuardedPoints.of(arm, guard)
        return ProgramPlanner(arm, guarded, self)


class Linearization(NamedTuple):
    """Values at bends, and their Jacobians by the bends.

    Attributes:
        states: [m, 1], shape (6 modules,).
        clearances: of the nearest pairs of guarded point and obstacle [m], shape (pairs,).
    """

    states: Float[Any, "*rows"]
    clearances: Float[Any, "*rows"]


class QuadraticProgram(NamedTuple):
    """min x^T H x / 2 + f^T x with A x <= b, the last rows soft."""

    hessian: Matrix
    gradient: Vector
    rows: Matrix
    bounds: Vector
    soft: int


class ProgramPlanner:
    """Builds the program of a control step, and has it solved."""

    def __init__(self, arm: ArmSpec, guarded: GuardedPoints, options: DifferentialIK):
        """Compile for an arm."""
        self._solve = _solver()
        self._options = options
        self._length = arm.length
        geometry = ArmGeometry.of(arm)
        self._geometry = geometry
        lengths = geometry.lengths.astype(np.float32)
        projectors = geometry.steerable
        if projectors is not None:
            projectors = projectors.astype(np.float32)
        self._linearized = compiled(_linearized, lengths, guarded, projectors)
        modules = arm.module_count
        # normals of the sides of every module's polygon, shape (sides modules, 2 modules)
        sides = np.arange(SIDES)
        angles = 2.0 * np.pi * sides / SIDES
        normals = directions_at(angles)
        self._normals = np.kron(np.eye(modules), normals)
        neighbors = np.diff(np.eye(modules), axis=0)
        differences = np.kron(neighbors, np.eye(2))
        self._evenness = differences.T @ differences
        rest = np.zeros((modules, 2), np.float32)
        self._linearized(rest, Goal.of(modules))

    def start(self, moment: Moment) -> None:
        """Begin with an arm at rest and no goal."""
        self._last_targets: Targets | None = None

    def next_bends(self, moment: Moment, goal: Goal) -> Bends:
        """Bends after the solution; the last ones without targets or a solution."""
        if not goal.has_target:
            return moment.bends
        program = self.program(moment.bends, goal)
        count = len(program.rows)
        hard = count - program.soft
        kinds = np.zeros(count, np.int32)
        kinds[hard:] = SOFT
        below = np.full(count, -1e30)
        change, _, flag, _ = self._solve(
            program.hessian,
            program.gradient,
            program.rows,
            program.bounds,
            below,
            kinds,
        )
        if flag <= 0:
            return moment.bends
        return moment.bends + np.reshape(change, (-1, 2))

    def program(self, bends: Bends, goal: Goal) -> QuadraticProgram:
        """The quadratic program in the change of bends."""
        linear = self._linearized(np.asarray(bends, np.float32), goal)
        values, slopes = jax.tree.map(_float64, linear)
        hessian, gradient = self._tasks(values.states, slopes.states, goal)
        flat = _float64(bends).reshape(-1)
        unevenness = POSTURE * self._evenness
        hessian += unevenness
        gradient += self._options.gain * unevenness @ flat
        # polygons in the discs of steps and of bends; no change is always allowed
        geometry = self._geometry
        inside = np.cos(np.pi / SIDES)
        step = inside * geometry.step_limit
        discs = inside * np.repeat(geometry.planned_bends, SIDES)
        room = discs - self._normals @ flat
        room = np.maximum(room, 0.0)
        within = np.minimum(step, room)
        at_hand = values.clearances < self._length
        clearances = values.clearances[at_hand]
        within_barriers = self._options.barrier_gain * clearances
        approaches = -slopes.clearances[at_hand]
        rows = np.concatenate([self._normals, approaches])
        bounds = np.concatenate([within, within_barriers])
        return QuadraticProgram(hessian, gradient, rows, bounds, len(clearances))

    def _tasks(
        self, states: Vector, slopes: Matrix, goal: Goal
    ) -> tuple[Matrix, Vector]:
        """Sum over tasks of the weighted squares of J x + gain e - v, and damping."""
        options = self._options
        targets = np.concatenate([goal.positions, goal.axes], axis=1)
        errors = states.reshape(targets.shape) - targets
        wanted = self._motion(targets) - options.gain * errors
        positions = goal.position_weights / self._length**2
        axes = goal.axis_weights * self._options.axis_weight**2
        weights = np.stack([positions, axes], axis=1)
        weights = np.repeat(weights, 3, axis=1)
        weighted = slopes.T * weights.reshape(-1)
        hessian = weighted @ slopes
        hessian += options.damping * np.eye(len(hessian))
        gradient = -weighted @ wanted.reshape(-1)
        return hessian, gradient

    def _motion(self, targets: Targets) -> Targets:
        """Motion v of targets in the last step; none where they jumped."""
        last = self._last_targets
        self._last_targets = targets
        if last is None:
            return np.zeros_like(targets)
        motion = targets - last
        ways = np.linalg.norm(motion[:, POSITION], axis=-1)
        farthest = self._geometry.step_limit * self._length
        is_jump = ways > farthest
        return np.where(is_jump[:, None], 0.0, motion)


def _float64(values: Any) -> np.ndarray:
    return np.asarray(values, float)


def _linearized(
    lengths: Float[Array, " modules"],
    guarded: GuardedPoints,
    projectors: Float[Array, "modules 2 2"] | None,
    bends: Bends,
    goal: Goal,
) -> tuple[Linearization, Linearization]:
    """Values at bends, and their Jacobians, shapes (rows, 2 modules)."""

    def states_of(flat: FlatBends) -> States:
        bends = flat.reshape(-1, 2)
        steered = commanded_part(bends, projectors)
        return states_from_bends(steered, lengths)

    flat = jnp.reshape(bends, -1)
    states = states_of(flat)
    nearby = Nearby.of(goal).nearest(states, guarded, OBSTACLES)
    clearances = nearby.clearances(states, guarded).reshape(-1)
    count = min(BARRIERS, len(clearances))
    _, pairs = jax.lax.top_k(-clearances, count)

    def values(flat: FlatBends) -> Linearization:
        states = states_of(flat)
        clearances = nearby.clearances(states, guarded).reshape(-1)
        return Linearization(states.reshape(-1), clearances[pairs])

    jacobians = jax.jacfwd(values)(flat)
    return values(flat), jacobians


def _solver() -> Any:
    """The solver of quadratic programs.

    Raises:
        S2C2AError: it is not installed.
    """
    with needs_extra("planners", "the strategy diff-ik"):
        import daqp  # noqa: PLC0415
    return daqp.solve
