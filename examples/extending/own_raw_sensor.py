"""A sensor with a formula: the distance between neighboring ends of modules, by a string.

    s2c2a run circle --robot own_raw_sensor.py:StringArm --arm string_arm.toml \\
        --weights mine.safetensors

string_arm.toml is a copy of the arm file (`s2c2a arm copy twin_arm string_arm.toml`) with

    [[sensors.raw]]
    name = "strings"
    shape = [3, 2]
    model = "own_raw_sensor.py:Strings"

The Kalman filter then estimates payload and bend biases from it. Nothing is trained.
"""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from s2c2a.estimation import FormulaSensor
from s2c2a.kinematics import bends_from_configurations
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Sensor

LENGTH = 0.2  # m; of a module
OFFSET = 0.02  # m; of the strings from the center line
NOISE = 2e-4  # m


def string_lengths(bends):
    """One string on the x side and one on the y side of every module."""
    return LENGTH - OFFSET * bends


class Strings(FormulaSensor):
    """Lengths of strings; a string shortens as the module bends towards it."""

    std = NOISE

    def predicted(self, bends):
        return string_lengths(bends)


class StringArm(SimulatedRobot):
    """The simulated arm with these strings."""

    @property
    def sensors(self):
        shape = (self.arm.module_count, 2)
        return super().sensors | {"strings": Sensor(shape, "m", 0.0, 1.0)}

    def read(self):
        reading = super().read()
        configurations = jnp.asarray(reading["configurations"])
        strings = string_lengths(np.asarray(bends_from_configurations(configurations)))
        strings = strings + self._random.normal(scale=NOISE, size=strings.shape)
        return replace(reading, sensors={**reading.sensors, "strings": strings})
