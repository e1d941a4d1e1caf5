"""Robots: the interface of every arm, simulated or real. NumPy only."""

from s2c2a.robots.factory import RobotFactory
from s2c2a.robots.robot import Robot, checked_action
