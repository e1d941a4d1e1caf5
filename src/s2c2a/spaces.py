"""State, Configuration, Action, Reading: shape, unit, frame and axis order, said once.

Frames. The base frame stands where the arm is mounted: z along the straight arm, x towards the cable at angle zero.
The frame of a module stands on the module's base in the same way. Axes are ordered (*batch, time, modules, features).

| word          | symbol | shape (..., modules, k)              | unit | frame  |
| ------------- | ------ | ------------------------------------ | ---- | ------ |
| State         | S      | 6: end position x y z, end axis x y z | m, 1 | base   |
| Configuration | C      | 3: unit vector of the end axis        | 1    | module |
| Bend          | b      | 2: angle times its direction          | rad  | module |
| Action        | A      | cables: displacement or tension       | m, N | cable  |

A displacement is positive where the cable gets longer (Chen et al. 2025, sec. II-C); a tension is never negative.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

POSITION = slice(0, 3)
AXIS = slice(3, 6)

CONFIGURATION_HISTORY = 4
"""How many sensed configurations C2A looks back on, C_t to C_{t-3} (Chen et al. 2025, eq. (8))."""
ACTION_HISTORY = 5
"""How many actions C2A looks back on, A_{t-1} to A_{t-5} (the same)."""

CENTRE_LINE_POINTS = 5
"""Points of each module's centre line that are watched and guarded, evenly spaced, the last one at its end."""

CentreLine = Float[np.ndarray, "moments points 3"]
States = Float[np.ndarray, "*batch modules 6"]
Configurations = Float[np.ndarray, "*batch modules 3"]
Bends = Float[np.ndarray, "*batch modules 2"]
Actions = Float[np.ndarray, "*batch modules cables"]


@dataclass(frozen=True)
class Reading:
    """What an arm says of itself at one moment.

    Attributes:
        time: seconds since the arm was opened.
        cables: what the cheap inner sensors measure, shape (modules, cables): displacement [m] or tension [N].
        states: true states, shape (modules, 6), base frame, or None where nothing outside watches the arm.
        configurations: true configurations, shape (modules, 3), or None as above.
        centre_line: where the true centre line was since the last reading, base frame [m]: at some moments, the newest
            last, `CENTRE_LINE_POINTS` points a module from base to tip, shape (moments, points, 3), or None.
    """

    time: float
    cables: Actions
    states: States | None = None
    configurations: Configurations | None = None
    centre_line: CentreLine | None = None
