"""Rollout: one run of a strategy on a task."""

from collections.abc import Callable

from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.robots import Robot
from s2c2a.runtime import Clock, Driver, Loop, StepRecord, StepRequest, build_episode
from s2c2a.spaces import Stage
from s2c2a.tasks import Task


def rollout(
    robot: Robot,
    strategy: Driver,
    task: Task,
    progress: Callable[[int, int], None] = lambda done, total: None,
    clock: Clock | None = None,
) -> Episode:
    """Run a strategy on a task, from rest and back to rest.

    Args:
        robot: robot to control; closed at the end.
        strategy: strategy for the robot's arm.
        task: one goal for every control step.
        progress: called with the number of steps done and of all steps.
        clock: source of time; see `Loop`.

    Returns:
        The episode, with the steps back to rest.

    Raises:
        S2C2AError: readings failed the check for so long that the arm was moved to
            rest; or robot, strategy, or goals failed.
    """
    with Loop(robot, strategy, clock) as loop:
        steps: list[StepRecord] = []
        for number, goal in enumerate(task.goals, 1):
            steps.append(loop.tick(StepRequest(goal)))
            while steps[-1].stage is Stage.START:
                steps.append(loop.tick(StepRequest(goal)))
            if steps[-1].stage not in (Stage.RUN, Stage.HOLD):
                steps += loop.to_rest()
                raise S2C2AError(
                    f"step {number} of '{task.name}': {steps[-1].fault}; "
                    "the arm was moved to rest; check the sensor, then run again"
                )
            progress(number, len(task.goals))
        steps += loop.to_rest()
        return build_episode(
            steps,
            robot.arm,
            strategy=strategy.name,
            task=task.name,
            late_steps=loop.late_steps,
        )
