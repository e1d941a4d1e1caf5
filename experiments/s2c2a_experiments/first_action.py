"""Start-up benchmark: compute the first action of an arm in a new process.

`s2c2a bench` starts `python -m s2c2a_experiments.first_action ARM`, which prints the time.
"""

import sys
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from s2c2a import arm, strategies
    from s2c2a.models.forward_model import ForwardModel


def default_model_and_strategy(
    arm: "arm.ArmSpec",
) -> "tuple[ForwardModel, strategies.Strategy]":
    """Forward model and strategy: the networks of the package, or else PCC."""
    from s2c2a import errors, strategies
    from s2c2a.models.forward_model import PCCForwardModel

    try:
        networks = strategies.shipped_networks(arm)
    except errors.StrategyError:
        planner = strategies.recipe_named("best").planner
        model = PCCForwardModel.of(arm)
        return model, strategies.pcc_strategy(arm, planner)
    return networks.c2s, strategies.s2c2a_strategy(networks)


def first_action(name: str) -> None:
    """Compute the first action of an arm, from rest towards a lateral target.

    Args:
        name: a preset or an arm file.
    """
    import numpy as np

    from s2c2a import goals, spaces
    from s2c2a.arm import load_arm

    arm = load_arm(name)
    strategy = default_model_and_strategy(arm)[1]
    straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
    cables = np.zeros((arm.module_count, arm.cable_count))
    reading = spaces.Reading(0.0, {"cables": cables, "configurations": straight})
    target = [0.2 * arm.length, 0.0, 0.9 * arm.length]
    strategy.start(reading)
    strategy.step(reading, goals.Goal.of(arm.module_count).with_position(target))


if __name__ == "__main__":
    first_action(sys.argv[1])
    print(time.time())
