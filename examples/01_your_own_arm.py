"""Describe an arm in Python, save it as a file, simulate it, and bend it."""

import numpy as np

import s2c2a
from s2c2a.arm import Cable, Module, Motor
from s2c2a.kinematics import PCC
from s2c2a.runtime import check_robot

module = Module(
    length=0.12,  # m
    cable_radius=0.02,  # m
    cable_angles_deg=(0, 90, 180, 270),
    mass=0.04,  # kg
    bending_stiffness=0.08,  # N m2
    bend_limit_deg=60,
    cable=Cable(stiffness=8000, backlash=0.0002),  # N/m, m
)
arm = s2c2a.ArmSpec(
    name="my_arm",
    actuation="displacement",
    gravity_direction=(0, 0, 1),  # a hanging arm: gravity along +z of the base
    motor=Motor(time_constant=0.05, speed_limit=0.1, pulley_radius=0.008),
    modules=(module, module),
)
s2c2a.save_arm(arm, "my_arm.toml", overwrite=True)

robot = s2c2a.SimulatedRobot(arm)
check_robot(robot)

with robot:
    # bends [rad]: module 1 towards x, module 2 towards -y
    desired = np.array([[0.6, 0.0], [0.0, -0.4]])
    action = np.asarray(PCC.of(arm).actions(desired))
    for _ in range(30):
        robot.step(action)  # send the action and wait for one control period
    for number, state in enumerate(robot.read()["states"], start=1):
        position = state[:3].round(3)
        axis = state[3:].round(2)
        print(f"module {number} ends at {position} m and points along {axis}")
