"""How an arm swings: the frequency and damping of its first bending mode, at rest."""

import mujoco
import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import ArmError
from s2c2a.robots.simulation.simulated_robot import SimulatedRobot

GROWTH = 1e-6  # 1/s; what is less is rounding


def first_mode(arm: ArmSpec, fidelity: str = "fast") -> tuple[float, float]:
    """Natural frequency [Hz] and damping ratio of the slowest bending mode about the straight arm.

    From the eigenvalues of MuJoCo's linearized transition over one physics step.
    Friction between motor and module is not part of it: the cables hold still.

    Raises:
        ArmError: the straight arm does not stay straight.
    """
    robot = SimulatedRobot(arm, fidelity)
    robot.open()
    size = 2 * robot.model.nv + robot.model.na
    transition = np.zeros((size, size))
    mujoco.mjd_transitionFD(
        robot.model, robot.data, 1e-6, True, transition, None, None, None
    )
    rates = (
        np.log(np.linalg.eigvals(transition).astype(complex)) / robot.model.opt.timestep
    )
    if rates.real.max() > GROWTH:
        raise ArmError(
            f"{arm.name} does not stand: off its axis it falls over (growing at {rates.real.max():.2g} /s); "
            "stiffen the modules or their cables, make them lighter, or hang the arm"
        )
    swinging = rates[np.abs(rates.imag) > 1e-3]
    slowest = (swinging if swinging.size else rates)[
        np.argmin(np.abs(swinging if swinging.size else rates))
    ]
    return float(np.abs(slowest) / (2 * np.pi)), float(-slowest.real / np.abs(slowest))
