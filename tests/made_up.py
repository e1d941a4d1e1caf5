"""Episodes of the preset driven by displacement, with columns that a test makes up."""

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.episodes import Episode

TWIN = load_arm("twin_arm")


def made_up(rows, arm=TWIN, **columns) -> Episode:
    """An episode at ten rows a second, at rest where its columns say nothing else."""
    steps = {"time": 0.1 * np.arange(rows), "actions": np.zeros((rows, 3, 3))}
    return Episode(arm, steps | columns)
