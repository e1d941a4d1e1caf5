"""A sensor of your own: two flex sensors a module, and a map to configurations.

The robot has the sensor `flex`, and the arm file names the map:
`sensing = "own_sensor.py:FlexMap"`.

    s2c2a robot check --robot own_sensor.py:FlexArm --arm flex_arm.toml
    s2c2a collect --robot own_sensor.py:FlexArm --arm flex_arm.toml --out flex.episodes
    s2c2a train flex.episodes --arm flex_arm.toml --out flex.safetensors
"""

from dataclasses import replace

import numpy as np

from s2c2a.arm import ArmSpec
from s2c2a.estimation import ConfigurationMap
from s2c2a.kinematics import configurations_from_bends
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.spaces import Reading, Sensor

# V, V/rad
REST = 1.5
GAIN = 0.8


class FlexMap(ConfigurationMap):
    """Configurations from the voltages of two strips a module, along x and y."""

    @property
    def sensors(self) -> tuple[str, ...]:
        return ("flex",)

    @classmethod
    def of(cls, arm: ArmSpec) -> "FlexMap":
        return cls()

    def __call__(self, sensors):
        return configurations_from_bends((sensors["flex"] - REST) / GAIN)


class FlexArm(SimulatedRobot):
    """The simulated arm with two flex sensors a module, which have noise."""

    @property
    def sensors(self):
        return super().sensors | {
            "flex": Sensor((self.arm.module_count, 2), "V", 0.0, 3.0, fastest=20.0)
        }

    def read(self) -> Reading:
        reading = super().read()
        x, y, z = reading["configurations"].T
        angle = np.arctan2(np.hypot(x, y), z)
        bends = np.stack([x, y], axis=-1) / np.sinc(angle / np.pi)[:, None]
        flex = REST + GAIN * bends + self._random.normal(scale=0.005, size=bends.shape)
        return replace(reading, sensors={**reading.sensors, "flex": flex})
