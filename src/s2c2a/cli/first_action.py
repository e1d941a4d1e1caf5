"""What `s2c2a bench` starts: `python -m s2c2a.cli.first_action ARM` loads what drives an arm, and acts once."""

import sys
from typing import TYPE_CHECKING

from s2c2a.cache import keep_programs

if TYPE_CHECKING:
    from s2c2a.arm import ArmSpec
    from s2c2a.kinematics import ForwardModel
    from s2c2a.strategies import Strategy


def driver_of(arm: "ArmSpec") -> "tuple[ForwardModel, Strategy]":
    """A forward model and a strategy that plans with it: networks where they come with the package, PCC elsewhere."""
    from s2c2a.errors import StrategyError
    from s2c2a.kinematics import PCCForwardModel
    from s2c2a.strategies import pcc_strategy, recipe_named, s2c2a_strategy, shipped_networks

    try:
        networks = shipped_networks(arm)
    except StrategyError:
        return PCCForwardModel.of(arm), pcc_strategy(arm, recipe_named("best").planner)
    return networks.c2s, s2c2a_strategy(networks)


def first_action(name: str) -> None:
    """The action of the first control step of an arm, from rest towards a point aside; `name` is a preset or a file."""
    import numpy as np

    from s2c2a.arm import load_arm
    from s2c2a.goals import Goal
    from s2c2a.spaces import Reading

    arm = load_arm(name)
    strategy = driver_of(arm)[1]
    straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
    cables = np.zeros((arm.module_count, arm.cable_count))
    reading = Reading(0.0, {"cables": cables, "configurations": straight})
    strategy.start(reading)
    strategy.step(reading, Goal.of(arm.module_count).with_position([0.2 * arm.length, 0.0, 0.9 * arm.length]))


if __name__ == "__main__":
    keep_programs()
    first_action(sys.argv[1])
    print("acted", flush=True)
