"""Sensors of an arm other than encoders, with the errors of real ones."""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from s2c2a.arm.fields import Free, Frozen, Number, between, optional

RESERVED_NAMES = {
    "accelerations",
    "angular_velocities",
    "bends",
    "imu",
    "current",
    "camera",
    "flex",
    "cables",
    "states",
    "configurations",
    "center_line",
    "tensions",
    "camera_positions",
    "camera_age",
    "inclinations",
}
"""Sensor names that the package uses."""
MAX_NUMBERS = 256
"""Of one raw sensor: every control step processes all of them."""
MAX_DELAY = 0.7
"""Of an image [s]; the filter keeps the past of so long, and uses no older image."""


class Inertial(Frozen):
    """Inertial sensors at the module ends, aligned with the frames there.

    The defaults have the size of cheap sensors (InvenSense MPU-6050, product
    specification: 400 ug / sqrt(Hz), 0.05 deg/s) with biases left by a calibration.
    """

    rate: Number = between(10, 2000, "Hz", "samples a second", 100.0)
    acceleration_noise: Number = between(
        0, 10, "m/s2", "standard deviation of a sample", 0.03
    )
    acceleration_bias: Number = between(
        0, 10, "m/s2", "standard deviation of the bias, new at every opening", 0.1
    )
    turn_noise_deg: Number = between(
        0, 100, "deg/s", "standard deviation of a sample", 0.1
    )
    turn_bias_deg: Number = between(
        0, 100, "deg/s", "standard deviation of the bias, new at every opening", 0.5
    )


class Camera(Frozen):
    """Camera or motion capture of module ends, with a delay and lost images.

    The defaults are an assumption on the poor side: motion capture is better in all.
    """

    rate: Number = between(0.1, 1000, "Hz", "images a second", 5.0)
    delay: Number = between(0, MAX_DELAY, "s", "age of an image when it is read", 0.15)
    lost: Number = between(0, 0.99, "1", "share of lost images", 0.1)
    noise: Number = between(0, 0.1, "m", "standard deviation of a position", 0.001)
    sees: Literal["tip", "ends"] = optional(
        "visible module ends: the last one, or all", "tip"
    )


class Flex(Frozen):
    """Resistive flex sensors along every module; their model is learned from data.

    Every strip has its own errors. They depend on `strips` only and stay the same at
    every opening. The defaults are assumptions; no data sheet states them for strips
    in a soft arm.
    """

    angles_deg: tuple[Free, ...] = optional(
        "angles of the strips around every module, from x to y [deg]",
        (0.0, 120.0, 240.0),
        min_length=1,
        max_length=12,
    )
    strips: int = optional("seed of the strips' own errors", 0, ge=0, le=2**31)
    gain_error: Number = between(
        0, 1, "1", "standard deviation of the gain between strips", 0.2
    )
    nonlinearity: Number = between(
        0, 1, "1/rad", "standard deviation of the change of the gain with the bend", 0.2
    )
    angle_error_deg: Number = between(
        0, 45, "deg", "standard deviation of the strip angles", 5.0
    )
    crosstalk: Number = between(
        0, 1, "1", "standard deviation of the gain from other modules' bends", 0.05
    )
    hysteresis: Number = between(
        0, 1, "rad", "half-width of the hysteresis between bend and reading", 0.02
    )
    noise: Number = between(0, 1, "rad", "standard deviation of a reading", 0.01)
    zero_error: Number = between(
        0, 1, "rad", "standard deviation of the bias, new at every opening", 0.05
    )
    drift: Number = between(
        0, 1, "rad", "standard deviation of the bias drift in a minute", 0.02
    )


class Raw(Frozen):
    """Additional sensor of a robot, of any kind.

    Its values follow from the bends: by a formula, or as learned from data.
    """

    name: str = Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,39}$", description="name in readings"
    )
    shape: tuple[Annotated[int, Field(ge=1, le=MAX_NUMBERS)], ...] = Field(
        min_length=1, max_length=4, description="shape of one reading"
    )
    model: str = optional(
        "class with a formula, file.py:Class; learned from data if empty", ""
    )

    @model_validator(mode="after")
    def _validate(self):
        count = math.prod(self.shape)
        if count > MAX_NUMBERS:
            raise ValueError(
                f"'{self.name}' has {count} numbers; the limit is {MAX_NUMBERS}"
            )
        return self


class Sensors(Frozen):
    """Sensors of an arm besides its encoders.

    Estimators use all of them, except in the recipes of the paper.
    """

    omitted_defaults: ClassVar[frozenset[str]] = frozenset(("raw",))

    bends: bool = optional(
        "whether true configurations are measured without delay", False
    )
    imu: Inertial | None = optional("inertial sensors at module ends")
    camera: Camera | None = optional("camera or motion capture of module ends")
    flex: Flex | None = optional("flex sensors along the modules")
    raw: tuple[Raw, ...] = optional("additional sensors of a robot", ())

    @model_validator(mode="after")
    def _validate(self):
        names = set(RESERVED_NAMES)
        for sensor in self.raw:
            if sensor.name in names:
                raise ValueError(
                    f"sensors.raw names '{sensor.name}', which is taken; "
                    "give every sensor another name"
                )
            names.add(sensor.name)
        return self

    @property
    def learned(self) -> "Sensors":
        """Only the sensors whose model is learned from data."""
        return Sensors(
            flex=self.flex, raw=tuple(sensor for sensor in self.raw if not sensor.model)
        )

    def learned_shapes(self, modules: int) -> dict[str, tuple[int, ...]]:
        """Return the shapes of sensors whose model is learned, by name in readings."""
        shapes: dict[str, tuple[int, ...]] = {}
        if self.flex:
            shapes["flex"] = (modules, len(self.flex.angles_deg))
        for sensor in self.raw:
            if not sensor.model:
                shapes[sensor.name] = sensor.shape
        return shapes
