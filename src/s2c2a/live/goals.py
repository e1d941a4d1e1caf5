"""What a request makes of a control step: its goal, what goes wrong on demand, and how well it went."""

from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry
from s2c2a.evaluation.metrics import clearances
from s2c2a.goals import Goal
from s2c2a.live.request import Request
from s2c2a.robots import Robot
from s2c2a.sensing import PAPER_COUPLING
from s2c2a.spaces import Reading
from s2c2a.viz.mesh import unit

POSITION = 1.0
AXIS = 2.0
OBSTACLE = 1.0
CHANGE = 0.5
"""The protocol's weights mu_p, mu_o, mu_ob and mu_d of a dragged target."""


def goal_of(request: Request, modules: int, task_goal: Goal | None) -> Goal:
    """The goal of one control step: the task's, or the target's, with the driver's obstacles and weights."""
    goal = Goal.of(modules, CHANGE) if task_goal is None else task_goal
    if task_goal is None and request.target is not None:
        goal = goal.with_position(request.target, POSITION)
    if task_goal is None and request.axis is not None:
        goal = goal.with_axis(request.axis, AXIS)
    factors = request.weights
    goal = goal._replace(
        position_weights=np.float32(factors.position) * goal.position_weights,
        axis_weights=np.float32(factors.axis) * goal.axis_weights,
        change_weight=np.float32(factors.change) * goal.change_weight,
    )
    added = [(*one.center, one.threshold) for one in request.obstacles]
    spheres = np.reshape([*goal.obstacles_in_use(), *added], (-1, 4))
    return goal.with_obstacles(
        spheres[:, :3], spheres[:, 3], float(factors.obstacle * goal.obstacle_weight)
    )


def judged(goal: Goal, tip: Float[np.ndarray, "3"]) -> tuple[float, float]:
    """How far the tip is from where the goal wants it, and least from a threshold [m]; NaN and infinite without."""
    error = float(np.linalg.norm(tip - goal.desired_positions()[-1]))
    return error, float(
        clearances(tip[None, None], goal.obstacles_in_use()[None])[0]
    ) / 100.0


@runtime_checkable
class Disturbable(Protocol):
    """A body that can be pushed and loaded; the simulated arm is one."""

    def push(self, force: Float[np.ndarray, "3"]) -> None:
        """Apply a force at the tip [N], base frame, until the next call."""

    def load(self, payload: float) -> None:
        """Hang a mass at the tip [kg] in place of the last one."""


class Disturbances:
    """What a driver makes go wrong with one body, and with its readings, in the words of the arm's own sensors."""

    def __init__(self, robot: Robot, seed: int = 0):
        """Nothing yet; a body that cannot be pushed is left alone. The sensors' noise starts from a seed."""
        self._body = robot if isinstance(robot, Disturbable) else None
        self._geometry = ArmGeometry.of(robot.arm)
        self._random = np.random.default_rng(seed)
        count = robot.arm.module_count
        self._leak = (
            np.array(PAPER_COUPLING) if count == len(PAPER_COUPLING) else np.eye(count)
        )
        self._request = Request()

    def begin(self) -> None:
        """The arm was opened anew, which ends pushes."""
        self._request = replace(self._request, push=Request.push)

    def apply(self, request: Request) -> None:
        """Push and load the body as the request says, where that has changed."""
        if self._body is not None and request.payload != self._request.payload:
            self._body.load(request.payload)
        if self._body is not None and request.push != self._request.push:
            self._body.push(np.array(request.push))
        self._request = request

    def spoilt(self, reading: Reading) -> Reading:
        """A reading as the latest request wants it; the truth beside it as it was.

        Its modules' bends are mixed, by a part of the paper's leak (eq. (11)) where
        that fits the arm, then shaken.
        """
        coupling = self._request.coupling
        noise = self._request.noise
        if not coupling and not noise:
            return reading
        said = dict(reading.sensors)
        geometry = self._geometry
        mixed = (1 - coupling) * np.eye(len(self._leak)) + coupling * self._leak
        if "cables" in said:
            scale = noise * np.abs(geometry.action_scale)[:, None]
            shaken = scale * self._random.normal(size=said["cables"].shape)
            said["cables"] = self._mixed_cables(said["cables"], mixed) + shaken
        if "configurations" in said:
            tilt = (
                noise
                * geometry.bend_limits[:, None]
                * self._random.normal(size=said["configurations"].shape)
            )
            said["configurations"] = unit(mixed @ said["configurations"] + tilt)
        return Reading(reading.time, said)

    def _mixed_cables(self, cables: np.ndarray, mixed: np.ndarray) -> np.ndarray:
        """Cables of the mixed bends; what the cables have in common stays."""
        geometry = self._geometry
        away = (cables - geometry.action_neutral) / geometry.action_scale[:, None]
        shares = np.einsum("mkc,mc->mk", geometry.bend_matrices, away)
        change = np.einsum(
            "mck,mk->mc", geometry.cable_matrices, mixed @ shares - shares
        )
        return cables + geometry.action_scale[:, None] * change
