"""Rollout: runs of a strategy on a task."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.robots import Robot
from s2c2a.runtime import Clock, Driver, Loop, StepRecord, StepRequest, build_episode
from s2c2a.runtime.operator import OPERATOR
from s2c2a.spaces import Stage
from s2c2a.tasks import Task
from s2c2a.tasks.repetition import (
    end_sensor,
    learned_offsets,
    moved_task,
    with_true_targets,
)

# s; at rest between repetitions: the tip of twin_arm, which swings by 71 mm in the first
# second after a circle, then moves by 1 mm
PAUSE = 2.0

StepProgress = Callable[[int, int], None]
Keep = Callable[[Episode], None]
OnStep = Callable[[StepRecord], None]


def forget(episode: Episode) -> None:
    """Discard the steps of an interrupted run."""


def ignore_step(step: StepRecord) -> None:
    """Leave a step to the episode at the end."""


def rollout(
    robot: Robot,
    strategy: Driver,
    task: Task,
    progress: StepProgress = lambda done, total: None,
    clock: Clock | None = None,
    keep: Keep = forget,
    on_step: OnStep = ignore_step,
) -> Episode:
    """Run a strategy on a task, from rest and back to rest.

    Args:
        robot: robot to control; closed at the end.
        strategy: strategy for the robot's arm.
        task: one goal for every control step.
        progress: called with the number of steps done and of all steps.
        clock: source of time; see `Loop`.
        keep: called with the episode so far if an error ends the run; its option
            `interrupted` is the message of the error.
        on_step: called with the record of every step; it must be quick.

    Returns:
        The episode, with the steps back to rest.

    Raises:
        S2C2AError: readings failed the check for so long that the arm was moved to
            rest; or robot, strategy, or goals failed.
    """
    with Loop(robot, strategy, clock, on_step=on_step) as loop:
        return _run_task(loop, task, progress, keep)


def repeated_rollout(
    robot: Robot,
    strategy: Driver,
    task: Task,
    repetitions: int,
    progress: StepProgress = lambda done, total: None,
    clock: Clock | None = None,
    keep: Keep = forget,
    on_step: OnStep = ignore_step,
) -> list[Episode]:
    """Repeat a task; measured errors of each repetition move the targets of the next.

    The robot stays open and rests in between (`tasks.repetition`).

    Args:
        robot: robot to control; closed at the end.
        strategy: strategy for the robot's arm.
        task: one goal for every control step.
        repetitions: their number.
        progress: called with the number of steps done and of all steps.
        clock: source of time; see `Loop`.
        keep: called with the episodes of all repetitions until an error; see
            `rollout`.
        on_step: see `rollout`.

    Returns:
        An episode for each repetition, with the targets of the task and the column
        `target_offsets`.

    Raises:
        S2C2AError: no sensor measures the module ends; or see `rollout`.
    """
    sensor = end_sensor(robot)
    steps = len(task.goals)
    offsets = np.zeros((steps, robot.arm.module_count, 3))
    episodes: list[Episode] = []

    def keep_all(interrupted: Episode) -> None:
        for episode in (*episodes, interrupted):
            keep(episode)

    with Loop(robot, strategy, clock, on_step=on_step) as loop:
        for number in range(repetitions):

            def report(done: int, _: int, before: int = number * steps) -> None:
                progress(before + done, repetitions * steps)

            episode = _run_task(loop, moved_task(task, offsets), report, keep_all)
            episodes.append(with_true_targets(episode, task, offsets))
            if number + 1 < repetitions:
                offsets = learned_offsets(episodes[-1], offsets, sensor)
                for _ in range(round(PAUSE * robot.arm.control_rate)):
                    loop.tick(StepRequest(enabled=False))
    return episodes


def _run_task(loop: Loop, task: Task, progress: StepProgress, keep: Keep) -> Episode:
    """One run from rest and back to rest."""
    late_before = loop.late_steps
    steps: list[StepRecord] = []

    def episode(**options: str) -> Episode:
        return build_episode(
            steps,
            loop.arm,
            strategy=loop.driver_name,
            task=task.name,
            late_steps=loop.late_steps - late_before,
            **options,
        )

    try:
        # append the record of every step, as soon as it is done
        for number, goal in enumerate(task.shown_goals(loop.arm), 1):
            steps.append(loop.tick(StepRequest(goal)))
            while steps[-1].stage is Stage.START:
                steps.append(loop.tick(StepRequest(goal)))
            if loop.standstill:
                # hold the arm until the operator resumes
                OPERATOR.ask(loop.standstill)
                fault = loop.standstill
                first = len(steps) - 1
                while (
                    loop.standstill
                    and OPERATOR.attends
                    and steps[-1].stage is Stage.HOLD
                ):
                    steps.append(loop.tick(StepRequest(goal, operator_present=False)))
                    if OPERATOR.agrees:
                        loop.resume()
                if loop.standstill:
                    steps.extend(loop.to_rest())
                else:
                    del steps[first:]
                    steps.append(replace(loop.tick(StepRequest(goal)), fault=fault))
            if steps[-1].stage not in (Stage.RUN, Stage.HOLD):
                steps.extend(loop.to_rest())
                raise S2C2AError(
                    f"step {number} of '{task.name}': {steps[-1].fault}; "
                    "the arm was moved to rest; correct that, then run again"
                )
            progress(number, len(task.goals))
        steps.extend(loop.to_rest())
    except BaseException as error:
        if steps:
            keep(episode(interrupted=str(error) or type(error).__name__))
        raise
    return episode()
