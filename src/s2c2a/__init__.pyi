from . import tasks
from .api import collect, load_strategy, run, train
from .arm import ArmSpec, load_arm, save_arm
from .data import Recording, load_recording
from .episodes import Episode, load_episodes, save_episodes
from .evaluation import score_run
from .goals import Goal
from .robots import Robot, RobotFactory
from .robots.simulation import SimulatedRobot
from .runtime import Loop, StepRequest, build_episode
from .strategies import Recipe, Strategy, pcc_strategy, recipe_from
from .tasks import Task

__all__ = [
    "ArmSpec",
    "Episode",
    "Goal",
    "Loop",
    "Recipe",
    "Recording",
    "Robot",
    "RobotFactory",
    "SimulatedRobot",
    "StepRequest",
    "Strategy",
    "Task",
    "build_episode",
    "collect",
    "load_arm",
    "load_episodes",
    "load_recording",
    "load_strategy",
    "pcc_strategy",
    "recipe_from",
    "run",
    "save_arm",
    "save_episodes",
    "score_run",
    "tasks",
    "train",
]

__version__: str
