"""What a user waits for: a strategy is loaded and does its first tick."""

import sys

import numpy as np

from s2c2a.planning import Goal
from s2c2a.spaces import Reading
from s2c2a.strategies import load_strategy, s2c2a_strategy


def first_tick(path: str) -> np.ndarray:
    """The action of the first control step, from rest towards a point aside, with whatever is compiled for it."""
    networks = load_strategy(path)
    arm = networks.arm
    straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
    reading = Reading(0.0, np.zeros((arm.module_count, arm.cable_count)), configurations=straight)
    strategy = s2c2a_strategy(networks)
    strategy.start(reading)
    aside = [0.2 * arm.length, 0.0, 0.9 * arm.length]
    return strategy.step(reading, Goal.of(arm.module_count).with_position(aside))


def main() -> None:
    """Entry point of a process that is timed; its argument is the strategy's file."""
    first_tick(sys.argv[1])
