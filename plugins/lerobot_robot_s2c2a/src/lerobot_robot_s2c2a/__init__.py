"""Soft robot arms of S2C2A in LeRobot.

LeRobot finds `S2C2ARobot` and `S2C2AExpert` here, by the names of their configurations.
"""

from lerobot_robot_s2c2a.configs import S2C2AExpertConfig, S2C2ARobotConfig
from lerobot_robot_s2c2a.devices import S2C2AExpert, S2C2ARobot
