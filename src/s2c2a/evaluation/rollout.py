"""One run of a strategy on a task."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry
from s2c2a.errors import S2C2AError
from s2c2a.robots import Robot
from s2c2a.strategies import AnyStrategy
from s2c2a.tasks import Task


@dataclass(frozen=True)
class Rollout:
    """What happened, one row a control step, each after the step's action.

    Attributes:
        task: what was asked.
        strategy: name of the strategy.
        times: [s], shape (steps,).
        states: true states, shape (steps, modules, 6), base frame.
        configurations: true configurations, shape (steps, modules, 3).
        sensed: sensed configurations before the action, shape (steps, modules, 3).
        planned: planned configurations, shape (steps, modules, 3).
        actions: as really sent [m or N], shape (steps, modules, cables).
        tick_times: sense, plan and act together [s], shape (steps,).
        centre_lines: true centre line between control steps too [m], shape (steps, moments, points, 3), or None where
            nothing watched it.
    """

    task: Task
    strategy: str
    times: Float[np.ndarray, " steps"]
    states: Float[np.ndarray, "steps modules 6"]
    configurations: Float[np.ndarray, "steps modules 3"]
    sensed: Float[np.ndarray, "steps modules 3"]
    planned: Float[np.ndarray, "steps modules 3"]
    actions: Float[np.ndarray, "steps modules cables"]
    tick_times: Float[np.ndarray, " steps"]
    centre_lines: Float[np.ndarray, "steps moments points 3"] | None = None


COLUMNS = ("times", "states", "configurations", "sensed", "planned", "actions", "tick_times")


def rollout(
    robot: Robot, strategy: AnyStrategy, task: Task, progress: Callable[[int, int], None] = lambda done, total: None
) -> Rollout:
    """Let a strategy work on a task, from rest and back to rest; the way back is not part of the run.

    Raises:
        S2C2AError: the robot tells no true states, so that nothing can be scored.
    """
    rows, lines = [], []
    with robot:
        reading = robot.read()
        if reading.states is None or reading.configurations is None:
            raise S2C2AError("this robot tells no true states; a run needs them to be scored")
        strategy.start(reading)
        for step, goal in enumerate(task.goals):
            began = time.perf_counter()
            action = strategy.step(reading, goal)
            took = time.perf_counter() - began
            sent = robot.send(action)
            reading = robot.read()
            rows.append(
                (reading.time, reading.states, reading.configurations, strategy.sensed, strategy.planned, sent, took)
            )
            lines.append(reading.centre_line)
            progress(step + 1, len(task.goals))
        return_to_rest(robot, sent)
    seen = None if any(line is None for line in lines) else np.array(lines)
    columns = dict(zip(COLUMNS, (np.array(column) for column in zip(*rows, strict=True)), strict=True))
    return Rollout(task, strategy.name, **columns, centre_lines=seen)


def return_to_rest(robot: Robot, action: np.ndarray) -> None:
    """Lead every cable back to neutral, no faster than the arm's step limit."""
    geometry = ArmGeometry.of(robot.arm)
    steps = int(np.ceil(np.rad2deg(geometry.bend_limits.max()) / robot.arm.step_limit_deg))
    for share in np.linspace(1.0, 0.0, steps + 1)[1:]:
        robot.send(geometry.action_neutral + share * (action - geometry.action_neutral))
