from .conformance import check_robot
from .factory import RobotFactory
from .robot import Robot, checked_action

__all__ = ["Robot", "RobotFactory", "check_robot", "checked_action"]
