"""States, configurations, bends, actions, readings: shapes, units, frames, axis order.

Frames. The base frame is where the arm is mounted: z along the straight arm, x towards
the cable at angle zero. The frame of a module is on the module's base, oriented in the
same way. Axes are ordered (*batch, time, modules, features).

| name          | symbol | shape (..., modules, k)               | unit | frame  |
| ------------- | ------ | ------------------------------------- | ---- | ------ |
| State         | S      | 6: end position x y z, end axis x y z | m, 1 | base   |
| Configuration | C      | 3: unit vector of the end axis        | 1    | module |
| Bend          | b      | 2: angle times its direction          | rad  | module |
| Action        | A      | cables: displacement or tension       | m, N | cable  |

A displacement is positive where the cable gets longer (Chen et al. 2025, sec. II-C); a
tension is never negative.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.errors import ReadingError, did_you_mean
from s2c2a.plugins.immutable import immutable, immutable_table, rebuilt
from s2c2a.printing import short_text

POSITION = slice(0, 3)  # of a state, as above
AXIS = slice(3, 6)  # likewise

CONFIGURATION_HISTORY = 4
"""Number of sensed configurations that C2A uses, C_t to C_{t-3} (Chen et al. 2025, eq.
(8))."""
ACTION_HISTORY = 5
"""Number of actions that C2A uses, A_{t-1} to A_{t-5} (Chen et al. 2025, eq. (8))."""

NOISE_LIMIT = 6.0
"""Standard deviations that Gaussian noise exceeds once in 5e8 numbers, so that what does
has another cause; every test of sensors and encoders has this limit."""
CENTER_LINE_POINTS = 5
"""Points of each module's center line that readings record and constraints check; they
are evenly spaced, the last one at the module's end."""

States = Float[np.ndarray, "*batch modules 6"]
"""End position [m] and end axis of every module, base frame."""
Configurations = Float[np.ndarray, "*batch modules 3"]
"""Unit vector of every module's end axis, module frame."""
Bends = Float[np.ndarray, "*batch modules 2"]
"""Bend vector of every module [rad], module frame."""
Actions = Float[np.ndarray, "*batch modules cables"]
"""Displacement [m] or tension [N] of every cable."""

FOLLOWS_FROM = {"configurations": "states"}
"""Sensors that can be computed from another sensor of the robot."""


class Stage(IntEnum):
    """Stages of a control loop (`runtime.stages`); files store the numbers."""

    IDLE = 0  # at rest, without a goal
    START = 1  # has a goal, but readings are not valid yet
    RUN = 2  # follows its goal
    HOLD = 3  # holds its configuration
    RELEASE = 4  # returns to rest
    FAULT = 5  # stands still until a reset

    def __str__(self) -> str:
        """Return the stage as text for users."""
        texts = (
            "at rest",
            "starting",
            "running",
            "holding",
            "going to rest",
            "stopped by a fault",
        )
        return texts[self]


@dataclass(frozen=True)
class Sensor:
    """Declaration of one sensor of a robot.

    Attributes:
        shape: shape of one reading.
        unit: unit of its values.
        low: smallest plausible value, or one per value.
        high: largest plausible value, or one per value.
        fastest: largest plausible rate of change of a value [unit/s], or one per value.
        always: whether every reading contains the sensor, with finite values. A camera
            is in a reading only after a new image, with NaN for what it does not see.

    Raises:
        ReadingError: a limit is no number, or does not fit the shape.
    """

    shape: tuple[int, ...]
    unit: str
    low: float | np.ndarray = -np.inf
    high: float | np.ndarray = np.inf
    fastest: float | np.ndarray = np.inf
    always: bool = True

    def __post_init__(self):
        """Check the limits and copy them, which a robot may change later."""
        object.__setattr__(self, "shape", tuple(self.shape))
        for name in ("low", "high", "fastest"):
            limit = getattr(self, name)
            if not _is_limit(limit, self.shape):
                raise ReadingError(
                    f"`{name}` of a sensor of shape {self.shape} is {limit!r}; give a "
                    "number, or an array of numbers of that shape"
                )
            object.__setattr__(self, name, immutable(limit))


def _is_limit(limit: Any, shape: tuple[int, ...]) -> bool:
    """Whether a limit is a number, or one for each value of a sensor."""
    numbers = np.asarray(limit)
    if numbers.dtype.kind not in "fiu":
        return False
    try:
        return np.broadcast_shapes(numbers.shape, shape) == shape
    except ValueError:
        return False


@dataclass(frozen=True)
class Reading:
    """Measurements of an arm at one time; what was not measured is absent.

    These names have the same meaning on every arm. Robots can have other sensors.

    | sensor               | meaning                    | shape              | unit   |
    | -------------------- | -------------------------- | ------------------ | ------ |
    | `cables`             | displacements, or tensions | (modules, cables)  | m or N |
    |                      | of a tension arm           |                    |        |
    | `states`             | true states, base frame    | (modules, 6)       | m, 1   |
    | `states_age`         | age of tracked states      | ()                 | s      |
    | `configurations`     | true configurations        | (modules, 3)       | 1      |
    | `tensions`           | from motor currents        | (modules, cables)  | N      |
    | `center_line`        | true center line, base to  | (samples, points,  | m      |
    |                      | tip, newest sample last    | 3)                 |        |
    | `accelerations`,     | of module ends, in the     | (samples, modules, | m/s2,  |
    | `angular_velocities` | frames there               | 3)                 | rad/s  |
    | `camera_positions`   | module ends in an image,   | (modules, 3)       | m      |
    |                      | base frame                 |                    |        |
    | `camera_age`         | age of that image          | ()                 | s      |
    | `flex`               | bends of flex sensors      | (modules, strips)  | rad    |

    True states come from motion capture or simulation. Those of a tracker are as old as
    `states_age`; episodes have them at the times of the readings. The center line has
    `CENTER_LINE_POINTS` points a module; it and the inertial sensors have all samples
    since the last reading. At rest, accelerations point up. Camera positions are NaN
    where an end is not visible, and absent without a new image.

    Nothing can change a reading: it copies its arrays when it is built, so that a robot
    may use its buffers again. `dataclasses.replace` makes a changed one.

    Attributes:
        time: time since the arm was opened [s].
        sensors: name -> values.
        fault: what is wrong with the robot, in a sentence for users; the arm is then
            held, as with an unsound reading. Empty if nothing is.
    """

    time: float
    sensors: Mapping[str, np.ndarray]
    fault: str = ""

    __repr__ = short_text

    def __post_init__(self):
        """Copy the values, and the time, which may be an array of no axes."""
        object.__setattr__(self, "time", immutable(self.time))
        object.__setattr__(self, "sensors", immutable_table(self.sensors))

    def __reduce__(self):
        """Support pickling, since readings travel between processes."""
        return rebuilt(self)

    def __getitem__(self, name: str) -> np.ndarray:
        """Return the values of a sensor.

        Raises:
            ReadingError: the sensor is not in this reading.
        """
        if name not in self.sensors:
            names = ", ".join(self.sensors) or "nothing"
            raise ReadingError(
                f"no '{name}' in this reading{did_you_mean(name, self.sensors)}; "
                f"it has {names}"
            )
        return self.sensors[name]

    def get(self, name: str) -> np.ndarray | None:
        """Return the values of a sensor, or None if it is not in this reading."""
        return self.sensors.get(name)

    def numbers(self, name: str, shape: tuple[int | None, ...]) -> np.ndarray | None:
        """Return the values of a sensor as floats, if they are numbers of this shape.

        Args:
            name: of the sensor.
            shape: that is expected; None where any length is.
        """
        values = self.sensors.get(name)
        if not isinstance(values, np.ndarray | np.generic | float | int):
            return None
        values = np.asarray(values)
        if values.dtype.kind not in "fiub" or values.ndim != len(shape):
            return None
        sizes = zip(values.shape, shape, strict=True)
        if any(expected not in (None, size) for size, expected in sizes):
            return None
        return values.astype(float)
