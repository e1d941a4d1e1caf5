"""Random streams of the simulation: one for each cause, so that none changes another."""

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Causes beside the noise of encoders and currents, which uses the seed alone."""

    JITTER = 1
    HOMING = 2
    INERTIAL = 3
    CAMERA = 4
    FLEX_STRIPS = 5
    FLEX_NOISE = 6
    SENSOR_FAULTS = 7
    HOMING_EVENT = 8


def random_stream(seed: int, stream: Stream, *numbers: int) -> np.random.Generator:
    """Generator of a stream, with further numbers such as that of the opening."""
    return np.random.default_rng([seed, stream, *numbers])
