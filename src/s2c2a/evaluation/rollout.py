"""One run of a strategy on a task."""

from collections.abc import Callable

from s2c2a.episodes import Episode
from s2c2a.errors import S2C2AError
from s2c2a.robots import Robot
from s2c2a.runtime import Ask, Clock, Loop, Step, episode_of
from s2c2a.spaces import Stage
from s2c2a.strategies import AnyStrategy
from s2c2a.tasks import Task


def rollout(
    robot: Robot,
    strategy: AnyStrategy,
    task: Task,
    progress: Callable[[int, int], None] = lambda done, total: None,
    clock: Clock | None = None,
) -> Episode:
    """Let a strategy work on a task, from rest and back to rest; the episode holds the way back, too.

    Args:
        robot: the body; closed in the end.
        strategy: for its arm.
        task: what is asked, step by step.
        progress: told how many steps of how many are done.
        clock: the wall's for a body that shares its time, else as fast as the body can.

    Raises:
        S2C2AError: a sensor could not be believed for so long that the arm was led to
            rest; or the body, the strategy or the goals failed.
    """
    with Loop(robot, strategy, clock) as loop:
        steps: list[Step] = []
        for number, goal in enumerate(task.goals, 1):
            steps.append(loop.tick(Ask(goal)))
            while steps[-1].stage is Stage.START:
                steps.append(loop.tick(Ask(goal)))
            if steps[-1].stage not in (Stage.RUN, Stage.HOLD):
                steps += loop.to_rest()
                raise S2C2AError(
                    f"step {number} of '{task.name}': {steps[-1].fault}; the arm was led to rest"
                )
            progress(number, len(task.goals))
        steps += loop.to_rest()
        return episode_of(
            steps,
            robot.arm,
            strategy=strategy.name,
            task=task.name,
            late_steps=loop.late_steps,
        )
