"""What a program writes first: collect, train, load a strategy, run it.

Each function does what the command of the same name does, with the same defaults; only
`collect` reads or completes a file that exists. Commands train with one thread, which
gives the same last bits on any number of cores. `import s2c2a` offers these functions, and
the classes that they need.
"""

import os
import warnings
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

from s2c2a import data, evaluation, strategies
from s2c2a.arm import ArmSpec
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.robots import Robot, RobotFactory
from s2c2a.runtime import Driver
from s2c2a.strategies import Recipe, RunOptions
from s2c2a.strategies.checkpoint import SHIPPED
from s2c2a.tasks import Task, load_task
from s2c2a.tasks.remarks import remarks


def collect(
    arm: ArmSpec,
    out: str | os.PathLike,
    *,
    episodes: int | None = None,
    samples: int = 500,
    seed: int = 0,
    recipe: Recipe | str | os.PathLike = "best",
    babbling: str | None = None,
    robot: RobotFactory = RobotFactory.simulation(),  # noqa: B008  # frozen
    resume: bool = True,
    overwrite: bool = False,
    threads: int | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] = lambda complete, episodes: None,
) -> Recording:
    """Record random motion of an arm (babbling), by default of the simulated one.

    Args:
        arm: to drive.
        out: the file to write, such as "twin.episodes".
        episodes: their number, each from rest; that of the recipe by default.
        samples: control steps of an episode.
        seed: of everything random.
        recipe: sets kind of babbling, speeds and episodes; a name, a file or a recipe.
            Use the same one in `train`.
        babbling: "staged", "motor" or "coverage", in place of the recipe's.
        robot: class of the robot and its options, such as
            `RobotFactory("my_arm.py:MyArm")`. A real arm is driven by one thread.
        resume: whether a file of the same arm and options is completed, or read if it is
            complete.
        overwrite: whether an existing file is replaced.
        threads: parallel episodes; all cores by default.
        executor: see `data.collect`.
        progress: called with the number of complete episodes and of all episodes.

    Raises:
        RecordingError: the file is of another arm or of other options, or a sensor
            failed.
    """
    chosen = strategies.recipe_from(recipe)
    defaults = chosen.collect_options(seed)
    options = replace(
        defaults,
        babbling=babbling or defaults.babbling,
        episodes=defaults.episodes if episodes is None else episodes,
        samples=samples,
    )
    return data.collect(
        out,
        arm,
        partial(robot.seeded, arm),
        options,
        robot=str(robot),
        threads=threads if robot.simulated else 1,
        executor=executor,
        resume=resume,
        overwrite=overwrite,
        progress=progress,
    )


def train(
    recording: Recording,
    out: str | os.PathLike,
    *,
    strategy: str = "s2c2a",
    recipe: Recipe | str | os.PathLike = "best",
    seed: int = 0,
    overwrite: bool = False,
    progress: strategies.NetworkProgress = lambda *_: None,
) -> Driver:
    """Train a strategy on a recording, and save its networks.

    Args:
        recording: with true states, of `collect` or `load_recording`.
        out: the weight file to write, such as "twin.safetensors".
        strategy: a name ("s2c2a", "s2c2a-motor", "pcc-fitted"), or file.py:Class.
        recipe: how to train and plan; a name, a file or a recipe.
        seed: of everything random.
        overwrite: whether an existing file is replaced.
        progress: called with network, epoch, number of epochs, validation loss.

    Returns:
        The strategy, as `load_strategy(out)` builds it again.

    Raises:
        StrategyError: the file exists, or there is no such strategy or recipe.
        RecordingError: the recording lacks true states or episodes.
        TrainingError: too few samples, or the loss is not finite.
    """
    strategies.check_new_networks(out, overwrite)
    chosen = strategies.recipe_from(recipe)
    networks = strategies.train_networks(recording, chosen, strategy, seed, progress)
    strategies.save_networks(networks, out)
    return strategies.strategy_of(_warned_of(networks))


def load_strategy(
    file: str | os.PathLike = SHIPPED,
    arm: ArmSpec | None = None,
    options: RunOptions = RunOptions(),  # noqa: B008  # frozen
) -> Driver:
    """Build a strategy from a weight file.

    Args:
        file: of `train`; "shipped" stands for the networks of the package, which needs
            the arm.
        arm: that is driven; that of the file by default.
        options: points kept out of obstacles, and what is known about the payload.

    Raises:
        StrategyError: no such file, damaged, trained for another arm, or it does not
            support an option.
    """
    networks = _warned_of(strategies.networks_from(file, arm))
    return strategies.strategy_of(networks, options)


def _warned_of(networks: strategies.TrainedNetworks) -> strategies.TrainedNetworks:
    """Networks, after a warning of a controller that errs much, as commands print it."""
    for line in evaluation.describe_held_out_errors(networks):
        if line.startswith("warning: "):
            warnings.warn(line.removeprefix("warning: "), stacklevel=3)
    return networks


def run(
    robot: Robot,
    strategy: Driver,
    task: Task | str,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Episode:
    """Run a strategy on a task, from rest and back to rest.

    Args:
        robot: to control, such as `SimulatedRobot(arm)`; closed at the end.
        strategy: of `train`, `load_strategy` or `pcc_strategy`.
        task: made by `tasks`, or as a text: a name, a file of waypoints (.csv), or
            file.py:function.
        progress: called with the number of steps done and of all steps.

    Returns:
        All readings, actions and estimates; `score_run` computes its errors.

    Raises:
        S2C2AError: readings failed the check for so long that the arm was moved to
            rest; or robot, strategy, or goals failed.
    """
    goals = task if isinstance(task, Task) else load_task(task, robot.arm)
    for text in remarks(goals, robot.arm):
        warnings.warn(text, stacklevel=2)
    episode = evaluation.rollout(robot, strategy, goals, progress)
    if text := evaluation.describe_faults(episode):
        warnings.warn(text, stacklevel=2)
    return episode
