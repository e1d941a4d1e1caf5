"""MuJoCo simulation of an arm: chain, cables, motors, sensors."""

from s2c2a.robots.simulation.chain import FIDELITIES
from s2c2a.robots.simulation.simulated_robot import SimulatedRobot
