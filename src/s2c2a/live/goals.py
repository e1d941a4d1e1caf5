"""Goal, disturbances and errors of one control step of the live page."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline

from s2c2a.arm import ArmGeometry
from s2c2a.estimation import PAPER_COUPLING
from s2c2a.evaluation.metrics import clearances
from s2c2a.goals import Goal
from s2c2a.live.request import Point, Request
from s2c2a.obstacles import ROW
from s2c2a.robots import Robot
from s2c2a.spaces import Reading
from s2c2a.tasks.scenes import goals_beside
from s2c2a.viz.mesh import unit

# the protocol's weights mu_p, mu_o and mu_d of a dragged target; its mu_ob is 1
POSITION = 1.0
AXIS = 2.0
CHANGE = 0.5


def goal_of(request: Request, modules: int, task_goal: Goal | None) -> Goal:
    """Goal of one control step.

    Args:
        request: adds its obstacles and multiplies the weights.
        modules: number of modules.
        task_goal: goal of the task, or None for the request's target.
    """
    goal = Goal.of(modules, CHANGE) if task_goal is None else task_goal
    if task_goal is None and request.target is not None:
        goal = goal.with_position(request.target, POSITION)
    if task_goal is None and request.ends is not None:
        goal = _with_shape(goal, request.ends)
    if task_goal is None and request.axis is not None:
        goal = goal.with_axis(request.axis, AXIS)
    factors = request.weights
    goal = goal._replace(
        position_weights=np.float32(factors.position) * goal.position_weights,
        axis_weights=np.float32(factors.axis) * goal.axis_weights,
        change_weight=np.float32(factors.change) * goal.change_weight,
        obstacle_weight=np.float32(factors.obstacle) * goal.obstacle_weight,
    )
    added = [obstacle.row for obstacle in request.obstacles]
    (beside,) = goals_beside([goal], np.reshape(added, (-1, ROW)))
    return beside


def curve_through(
    ends: Sequence[Point],
) -> tuple[CubicSpline, Float[np.ndarray, " knots"]]:
    """Smooth curve that leaves the base along z and passes through the modules' ends.

    Returns:
        the curve [m], and its parameter at the base and at each end.
    """
    knots = np.concatenate([np.zeros((1, 3)), ends])
    # ends in one place would stop the parameter
    moved = np.diff(knots, axis=0)
    steps = np.maximum(np.linalg.norm(moved, axis=-1), 1e-6)
    parameters = np.append(0.0, np.cumsum(steps))
    along_z = np.array([0.0, 0.0, 1.0])
    curve = CubicSpline(parameters, knots, bc_type=((1, along_z), (2, np.zeros(3))))
    return curve, parameters


def _with_shape(goal: Goal, ends: Sequence[Point]) -> Goal:
    """The goal with desired ends of all modules, and the curve's tangents there."""
    curve, parameters = curve_through(ends)
    tangents = curve(parameters, 1)[1:]
    for module, (end, tangent) in enumerate(zip(ends, tangents, strict=True)):
        goal = goal.with_position(end, POSITION, module)
        if tangent.any():
            goal = goal.with_axis(tangent, AXIS, module)
    return goal


def tip_errors(
    goal: Goal, tip: Float[np.ndarray, "3"], radius: float = 0.0
) -> tuple[float, float]:
    """Distance of the tip from its target, and of its body from the obstacles [m].

    They are NaN without a target and infinite without obstacles.
    """
    error = float(np.linalg.norm(tip - goal.desired_positions()[-1]))
    clearance_cm = clearances(tip[None, None], goal.obstacles_in_use()[None], radius)[0]
    return error, float(clearance_cm) / 100.0


@runtime_checkable
class Disturbable(Protocol):
    """A robot that accepts an external force and a payload, as the simulated arm."""

    def apply_force(self, force: Float[np.ndarray, "3"]) -> None:
        """Apply a force at the tip [N], base frame, until the next call."""

    def set_payload(self, payload: float) -> None:
        """Attach a mass at the tip [kg] that replaces the last one."""


class RequestedDisturbances:
    """Disturbs a robot, and its readings by sensor faults, as requested."""

    def __init__(self, robot: Robot):
        """Start without disturbances.

        A robot that is not `Disturbable` gets sensor faults only.
        """
        self._robot = robot if isinstance(robot, Disturbable) else None
        self._geometry = ArmGeometry.of(robot.arm)
        self._random = np.random.default_rng(0)
        self._coupling = np.eye(robot.arm.module_count)
        if len(self._coupling) == len(PAPER_COUPLING):
            self._coupling = np.array(PAPER_COUPLING)
        self._request = Request()

    def begin(self) -> None:
        """Forget the force, since a reopened robot has none."""
        self._request = replace(self._request, force=Request.force)

    def apply(self, request: Request) -> None:
        """Apply changes of the force and payload to the robot."""
        if self._robot is not None and request.payload != self._request.payload:
            self._robot.set_payload(request.payload)
        if self._robot is not None and request.force != self._request.force:
            self._robot.apply_force(np.array(request.force))
        self._request = request

    def corrupt(self, reading: Reading) -> Reading:
        """The reading with the requested sensor faults; true states do not change.

        The modules' bends are mixed by a part of the paper's coupling (eq. (11)), where
        that fits the arm; then noise is added.
        """
        coupling = self._request.coupling
        noise = self._request.noise
        if not coupling and not noise:
            return reading
        sensors = dict(reading.sensors)
        geometry = self._geometry
        mixing = (1 - coupling) * np.eye(len(self._coupling))
        mixing += coupling * self._coupling
        if "cables" in sensors:
            cables = sensors["cables"]
            scale = noise * np.abs(geometry.action_scale)[:, None]
            error = scale * self._random.normal(size=cables.shape)
            error = (
                geometry.cable_matrices.any(axis=-1) * error
            )  # no noise without cable
            sensors["cables"] = self._mixed_cables(cables, mixing) + error
        if "configurations" in sensors:
            axes = sensors["configurations"]
            scale = noise * geometry.bend_limits[:, None]
            error = scale * self._random.normal(size=axes.shape)
            sensors["configurations"] = unit(mixing @ axes + error)
        return replace(reading, sensors=sensors)

    def _mixed_cables(self, cables: np.ndarray, mixing: np.ndarray) -> np.ndarray:
        """Cables of the mixed bends; the cables' common part does not change."""
        geometry = self._geometry
        scale = geometry.action_scale[:, None]
        actions = (cables - geometry.action_neutral) / scale
        bends = geometry.bends_of(actions)
        change = mixing @ bends - bends
        return cables + scale * np.einsum("mck,mk->mc", geometry.cable_matrices, change)
