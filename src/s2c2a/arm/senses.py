"""What an arm senses beside what its motors tell: with the faults that real parts have."""

from typing import Literal

from pydantic import Field

from s2c2a.arm.fields import Frozen, Number, between


class Inertial(Frozen):
    """An inertial sensor at the end of every module, aligned with the module's frame there."""

    rate: Number = between(10, 2000, "Hz", "samples a second", 100.0)
    acceleration_noise: Number = between(0, 10, "m/s2", "standard deviation of a sample", 0.03)
    acceleration_bias: Number = between(0, 10, "m/s2", "standard deviation of its zero, anew at every opening", 0.1)
    turn_noise_deg: Number = between(0, 100, "deg/s", "standard deviation of a sample", 0.1)
    turn_bias_deg: Number = between(0, 100, "deg/s", "standard deviation of its zero, anew at every opening", 0.5)


class Camera(Frozen):
    """A camera, or motion capture, that sees where ends of modules are: slowly, late, and not always."""

    rate: Number = between(0.1, 1000, "Hz", "pictures a second", 5.0)
    delay: Number = between(0, 0.7, "s", "age of a picture when it is read", 0.15)
    lost: Number = between(0, 0.99, "1", "part of the pictures that are lost", 0.1)
    noise: Number = between(0, 0.1, "m", "standard deviation of a position", 0.001)
    sees: Literal["tip", "ends"] = Field(default="tip", description="the end of the last module, or of all")


class Senses(Frozen):
    """Sensors beside the encoders, each there if it is named; what is there is used, but by recipes of the paper."""

    bends: bool = Field(default=False, description="whether something sees how every module bends, at once")
    imu: Inertial | None = Field(default=None, description="inertial sensors at modules' ends")
    camera: Camera | None = Field(default=None, description="something that sees ends of modules")
