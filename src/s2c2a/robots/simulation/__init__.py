"""MuJoCo simulation of an arm: chain, cables, motors, sensors."""

from s2c2a.execution.child import safe_path

with safe_path():  # GLFW, which it imports, tries libraries in processes of Python
    import mujoco as mujoco

from s2c2a.robots.simulation.chain import FIDELITIES
from s2c2a.robots.simulation.simulated_robot import SimulatedRobot
