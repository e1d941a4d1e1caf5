"""The arm in MuJoCo: chain, cables, motors."""

from s2c2a.robots.simulation.chain import FIDELITIES, Fidelity
from s2c2a.robots.simulation.simulated_robot import SimulatedRobot
