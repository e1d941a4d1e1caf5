"""What an arm sensors beside what its motors tell: with the faults that real parts have."""

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from s2c2a.arm.fields import Frozen, Number, between

TAKEN = {
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
TAKEN |= {"accelerations", "angular_velocities", "bends", "imu", "current", "camera"}
"""Words of the package's own."""
MAX_NUMBERS = 256
"""Of one sensor of a body's own: a control step has to weigh them all."""


class Inertial(Frozen):
    """An inertial sensor at the end of every module, aligned with the module's frame there."""

    rate: Number = between(10, 2000, "Hz", "samples a second", 100.0)
    acceleration_noise: Number = between(
        0, 10, "m/s2", "standard deviation of a sample", 0.03
    )
    acceleration_bias: Number = between(
        0, 10, "m/s2", "standard deviation of its zero, anew at every opening", 0.1
    )
    turn_noise_deg: Number = between(
        0, 100, "deg/s", "standard deviation of a sample", 0.1
    )
    turn_bias_deg: Number = between(
        0, 100, "deg/s", "standard deviation of its zero, anew at every opening", 0.5
    )


class Camera(Frozen):
    """A camera, or motion capture, that sees where ends of modules are: slowly, late, and not always."""

    rate: Number = between(0.1, 1000, "Hz", "pictures a second", 5.0)
    delay: Number = between(0, 0.7, "s", "age of a picture when it is read", 0.15)
    lost: Number = between(0, 0.99, "1", "part of the pictures that are lost", 0.1)
    noise: Number = between(0, 0.1, "m", "standard deviation of a position", 0.001)
    sees: Literal["tip", "ends"] = Field(
        default="tip", description="the end of the last module, or of all"
    )


class Flex(Frozen):
    """Strips along every module whose resistance says how far they bend; what each makes of it is learned.

    Strips are cheap, and no two alike: how each errs goes with `strips`, and stays the
    same whenever the arm is opened.
    """

    angles_deg: tuple[Annotated[Number, Field(ge=-360, le=360)], ...] = Field(
        default=(0.0, 120.0, 240.0),
        min_length=1,
        max_length=12,
        description="where strips are round every module, from x to y [deg]",
    )
    strips: int = Field(
        default=0,
        ge=0,
        le=2**31,
        description="which strips: another number, others of the same kind",
    )
    gain_error: Number = between(
        0, 1, "1", "standard deviation of each one's own sensitivity", 0.2
    )
    nonlinearity: Number = between(
        0, 1, "1/rad", "standard deviation of what that changes by, by bend", 0.2
    )
    angle_error_deg: Number = between(
        0, 45, "deg", "standard deviation of where each one is", 5.0
    )
    crosstalk: Number = between(
        0, 1, "1", "standard deviation of the parts of other modules' bends in it", 0.05
    )
    hysteresis: Number = between(
        0,
        1,
        "rad",
        "half-width of the bend that it does not follow when bent back",
        0.02,
    )
    noise: Number = between(0, 1, "rad", "standard deviation of a reading", 0.01)
    zero_error: Number = between(
        0, 1, "rad", "standard deviation of its zero, anew at every opening", 0.05
    )
    drift: Number = between(
        0, 1, "rad", "standard deviation of how far its zero wanders in a minute", 0.02
    )


class Raw(Frozen):
    """A sensor of a body's own, of any kind; what its numbers have to do with bends is learned."""

    name: str = Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,39}$", description="its word in readings"
    )
    shape: tuple[Annotated[int, Field(ge=1, le=MAX_NUMBERS)], ...] = Field(
        min_length=1, max_length=4, description="of one reading"
    )

    @model_validator(mode="after")
    def _not_too_many(self):
        if (count := math.prod(self.shape)) > MAX_NUMBERS:
            raise ValueError(
                f"'{self.name}' has {count} numbers; take at most {MAX_NUMBERS}"
            )
        return self


class Sensors(Frozen):
    """Sensors beside the encoders, each there if it is named; what is there is used, but by recipes of the paper."""

    unsaid: ClassVar[frozenset[str]] = frozenset(("raw",))

    bends: bool = Field(
        default=False,
        description="whether something sees how every module bends, at once",
    )
    imu: Inertial | None = Field(
        default=None, description="inertial sensors at modules' ends"
    )
    camera: Camera | None = Field(
        default=None, description="something that sees ends of modules"
    )
    flex: Flex | None = Field(
        default=None, description="strips that say how far modules bend"
    )
    raw: tuple[Raw, ...] = Field(
        default=(), min_length=0, max_length=8, description="of a body's own"
    )

    @model_validator(mode="after")
    def _named_once(self):
        names = [one.name for one in self.raw]
        if wrong := [name for name in names if name in TAKEN or names.count(name) > 1]:
            raise ValueError(
                f"sensors.raw names '{wrong[0]}', which is taken; give every sensor a name of its own"
            )
        return self

    @property
    def learned(self) -> "Sensors":
        """Those alone whose numbers have to be learned."""
        return Sensors(flex=self.flex, raw=self.raw)

    def learned_shapes(self, modules: int) -> dict[str, tuple[int, ...]]:
        """Names in readings of those whose numbers have to be learned, and their shapes."""
        strips = {"flex": (modules, len(self.flex.angles_deg))} if self.flex else {}
        return strips | {one.name: one.shape for one in self.raw}
