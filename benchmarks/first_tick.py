"""Load a strategy file and run its first control step: `python first_tick.py FILE`."""

import sys

import numpy as np

from s2c2a.goals import Goal
from s2c2a.spaces import Reading
from s2c2a.strategies import load_networks, s2c2a_strategy

networks = load_networks(sys.argv[1])
arm = networks.arm
strategy = s2c2a_strategy(networks)
cables = np.zeros((arm.module_count, arm.cable_count))
straight = np.tile([0.0, 0.0, 1.0], (arm.module_count, 1))
reading = Reading(0.0, {"cables": cables, "configurations": straight})
strategy.start(reading)
strategy.step(
    reading,
    Goal.of(arm.module_count).with_position([0.2 * arm.length, 0.0, 0.9 * arm.length]),
)
