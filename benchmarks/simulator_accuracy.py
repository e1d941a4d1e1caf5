"""Distance of the simulated arm at rest from a rod model with the same cables."""

from dataclasses import dataclass

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.robots.simulation import FIDELITIES, SimulatedRobot

from rod import rod_shape
from rod_cases import RodCase, rod_cases

STILL = 1e-6  # m that the tip may still move in a control step at rest
MAX_STEPS = 400


@dataclass(frozen=True)
class StaticError:
    """Distance of the simulated tip to the rod's in one case [m]."""

    case: str
    fidelity: str
    error: float


def static_errors() -> list[StaticError]:
    """Every case in every fidelity."""
    errors = []
    for case in rod_cases():
        rod_tip = rod_shape(case.arm, case.tensions, case.tip_force)[-1, :3]
        for fidelity in FIDELITIES:
            tip = settled_tip(case.arm, case, fidelity)
            errors.append(
                StaticError(case.name, fidelity, float(np.linalg.norm(tip - rod_tip)))
            )
    return errors


def settled_tip(arm: ArmSpec, case: RodCase, fidelity: str) -> np.ndarray:
    """Where the simulated tip comes to rest [m], base frame."""
    with SimulatedRobot(arm, fidelity) as robot:
        robot.push(case.tip_force)
        last = np.full(3, np.inf)
        for _ in range(MAX_STEPS):
            robot.step(case.tensions)
            tip = robot.states()[-1, :3]
            if np.linalg.norm(tip - last) < STILL:
                break
            last = tip
        return tip


if __name__ == "__main__":
    for one in static_errors():
        print(f"case {one.case}, {one.fidelity}: {1e3 * one.error:.2f} mm")
