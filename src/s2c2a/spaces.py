"""State, Configuration, Action, Reading: shape, unit, frame and axis order, said once.

Frames. The base frame stands where the arm is mounted: z along the straight arm, x
towards the cable at angle zero. The frame of a module stands on the module's base in
the same way. Axes are ordered (*batch, time, modules, features).

| word          | symbol | shape (..., modules, k)              | unit | frame  |
| ------------- | ------ | ------------------------------------ | ---- | ------ |
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

import numpy as np
from jaxtyping import Float

from s2c2a.errors import ReadingError

POSITION = slice(0, 3)
AXIS = slice(3, 6)

CONFIGURATION_HISTORY = 4
"""How many sensed configurations C2A looks back on, C_t to C_{t-3} (Chen et al. 2025,
eq. (8))."""
ACTION_HISTORY = 5
"""How many actions C2A looks back on, A_{t-1} to A_{t-5} (the same)."""

CENTER_LINE_POINTS = 5
"""Points of each module's center line that are watched and guarded, evenly spaced, the
last one at its end."""

States = Float[np.ndarray, "*batch modules 6"]
Configurations = Float[np.ndarray, "*batch modules 3"]
Bends = Float[np.ndarray, "*batch modules 2"]
Actions = Float[np.ndarray, "*batch modules cables"]

FOLLOWS_FROM = {"configurations": "states"}
"""Sensors that another one says as well, for bodies that have only the other."""


class Stage(IntEnum):
    """What an arm that is driven is doing (`runtime.stages`); the numbers stand in files."""

    IDLE = 0  # at rest, nothing asked
    START = 1  # asked, but its readings are not sound yet
    RUN = 2  # does what is asked
    HOLD = 3  # stays where it is
    RELEASE = 4  # is led back to rest
    FAULT = 5  # stands still until somebody resets it

    def __str__(self) -> str:
        """In words."""
        return (
            "at rest",
            "starting",
            "running",
            "holding",
            "going to rest",
            "stopped by a fault",
        )[self]


@dataclass(frozen=True)
class Sensor:
    """What a body declares of one of its sensors.

    Attributes:
        shape: of one reading.
        unit: of its numbers.
        low: least plausible number, or one each.
        high: largest plausible number, or one each.
        fastest: largest plausible change of a number in a second.
        always: whether every reading holds it; a camera has its pictures when it has
            them, and not of everything (NaN).
    """

    shape: tuple[int, ...]
    unit: str
    low: float | np.ndarray = -np.inf
    high: float | np.ndarray = np.inf
    fastest: float | np.ndarray = np.inf
    always: bool = True


@dataclass(frozen=True)
class Reading:
    """What an arm says of itself at one moment; what was not measured is absent.

    These names mean the same on every arm, others are the body's own:

    | sensor           | what it says                                                    | shape              | unit   |
    | ---------------- | --------------------------------------------------------------- | ------------------ | ------ |
    | `cables`         | displacements, or tensions of an arm driven by tension          | (modules, cables)  | m or N |
    | `states`         | true states, base frame: motion capture, or simulation          | (modules, 6)       | m, 1   |
    | `configurations` | true configurations                                             | (modules, 3)       | 1      |
    | `tensions`       | tensions of the cables as the motors' currents tell them        | (modules, cables)  | N      |
    | `center_line`    | where the true center line was since the last reading, the      | (moments, points,  | m      |
    |                  | newest last; `CENTER_LINE_POINTS` a module from base to tip     | 3)                 |        |
    | `accelerations`, | what inertial sensors at modules' ends felt since the last      | (samples, modules, | m/s2,  |
    | `angular_velocities`     | reading, in module frames there; at rest they accelerate upward | 3)                 | rad/s  |
    | `camera_positions`           | ends as a camera saw them, NaN where it did not, base frame; in | (modules, 3)       | m      |
    |                  | readings that no picture came with it is absent                 |                    |        |
    | `camera_age`       | how old that picture is                                         | ()                 | s      |
    | `flex`           | what strips along the modules say of how far they bend          | (modules, strips)  | rad    |

    Attributes:
        time: seconds since the arm was opened.
        sensors: name -> numbers.
    """

    time: float
    sensors: Mapping[str, np.ndarray]

    def __getitem__(self, name: str) -> np.ndarray:
        """What a sensor says.

        Raises:
            ReadingError: it says nothing in this reading.
        """
        if name not in self.sensors:
            raise ReadingError(
                f"no '{name}' in this reading; it has {', '.join(self.sensors) or 'nothing'}"
            )
        return self.sensors[name]

    def get(self, name: str) -> np.ndarray | None:
        """The same, None where it says nothing."""
        return self.sensors.get(name)
