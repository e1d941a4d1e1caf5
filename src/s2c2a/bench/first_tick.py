"""What a user waits for: a strategy is loaded and does its first tick."""

import sys

import numpy as np

from s2c2a.spaces import Reading
from s2c2a.strategies import load_strategy, s2c2a_strategy
from s2c2a.tasks import circle


def first_tick(path: str) -> np.ndarray:
    """The action of the first control step on the circle, from rest, with whatever is compiled for it."""
    networks = load_strategy(path)
    arm = networks.arm
    straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
    reading = Reading(0.0, np.zeros((arm.module_count, arm.cable_count)), configurations=straight)
    strategy = s2c2a_strategy(networks)
    strategy.start(reading)
    return strategy.step(reading, circle(arm).goals[0])


def main() -> None:
    """Entry point of a process that is timed; its argument is the strategy's file."""
    first_tick(sys.argv[1])
