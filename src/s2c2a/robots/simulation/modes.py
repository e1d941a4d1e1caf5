"""Modal analysis: frequency and damping ratio of the first bending mode at rest."""

import mujoco
import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.errors import ArmError
from s2c2a.robots.simulation.simulated_robot import SimulatedRobot

MAX_GROWTH_RATE = 1e-6  # 1/s; smaller rates are rounding errors
MIN_FREQUENCY = 1e-3  # rad/s; slower modes do not oscillate


def first_mode(arm: ArmSpec) -> tuple[float, float]:
    """Return natural frequency [Hz] and damping ratio of the first bending mode.

    They follow from the eigenvalues of MuJoCo's transition matrix over one physics
    step, linearized about the straight arm. The motors hold still, so friction between
    motor and module has no influence.

    Raises:
        ArmError: the straight arm is not stable.
    """
    robot = SimulatedRobot(arm)
    robot.open()
    size = 2 * robot.model.nv + robot.model.na
    transition = np.zeros((size, size))
    # smaller steps are below what the solver of implicit springs resolves on thin arms
    mujoco.mjd_transitionFD(
        robot.model, robot.data, 1e-5, True, transition, None, None, None
    )
    eigenvalues = np.linalg.eigvals(transition).astype(complex)
    rates = np.log(eigenvalues) / robot.model.opt.timestep
    growth = rates.real.max()
    if growth > MAX_GROWTH_RATE:
        raise ArmError(
            f"{arm.name} is not stable upright: small bends grow at {growth:.2g} /s; "
            "give the modules or their cables more stiffness or less mass, "
            "or mount the arm hanging"
        )
    oscillating = rates[np.abs(rates.imag) > MIN_FREQUENCY]
    if oscillating.size:
        rates = oscillating
    slowest = rates[np.argmin(np.abs(rates))]
    frequency = np.abs(slowest)  # rad/s
    return float(frequency / (2 * np.pi)), float(-slowest.real / frequency)
