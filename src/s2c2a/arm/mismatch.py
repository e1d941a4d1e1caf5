"""How a simulated body differs from what its arm file says of it: nobody else is told."""

from typing import Annotated, Any

import numpy as np
from pydantic import Field, model_validator

from s2c2a.arm.fields import Frozen, Number, Numbers, Within, between

SLOWLY = (2.0, 20.0)  # s


class Mismatch(Frozen):
    """What a real module has and its description does not: all of it zero, or as described, unless stated.

    Numbers beside these in a module are nominal: geometry, estimators, models and
    planners know them and nothing else. Only the simulation reads this table.
    """

    angle_errors_deg: Annotated[Numbers, Within(-45, 45)] = Field(
        default=0.0, description="how far cables are from their angles [deg]"
    )
    radius_errors: Annotated[Numbers, Within(-0.5, 0.5)] = Field(
        default=0.0,
        description="how much further out cables are, in parts of cable_radius [1]",
    )
    coupling: Number | None = between(
        0,
        1,
        "1",
        "where its cables run through the modules below, in parts of their radius; in tubes if none",
        None,
    )
    mass_error: Number = between(
        -0.9, 9, "1", "how much heavier it is, in parts of its mass", 0.0
    )
    stiffness_error: Number = between(
        -0.9, 9, "1", "how much stiffer it is, in parts of EI and GJ", 0.0
    )
    stiffness_ratio: Number = between(
        0.1,
        10,
        "1",
        "EI in its stiff direction over that across; their geometric mean is EI",
        1.0,
    )
    stiff_direction_deg: Number = between(
        -3600, 3600, "deg", "which way it is stiff, from x to y", 0.0
    )
    hardening: Number = between(
        0,
        5,
        "1",
        "how much stiffer it is at full bend, growing with the square of the bend about each axis",
        0.0,
    )
    relaxing: tuple[Number, Number] = Field(
        default=(0.0, 0.0),
        description="parts of its stiffness that a held bend loses in the end, below one together [1]",
    )
    relaxation_times: tuple[Number, Number] = Field(
        default=SLOWLY, description="time constants of these two parts [s]"
    )
    axial_stiffness: Number | None = between(
        10,
        1e7,
        "N",
        "EA: cables shorten the center line by their tension over it; not at all if none",
        None,
    )
    rest_bend_deg: Number = between(0, 90, "deg", "bend without any force", 0.0)
    rest_azimuth_deg: Number = between(
        -3600, 3600, "deg", "which way that is, from x to y", 0.0
    )
    drift: Number = between(
        -0.5,
        0.5,
        "1",
        "part of what its motors do that is lost on the way once the arm has aged",
        0.0,
    )

    @model_validator(mode="after")
    def _can_relax(self):
        if min(self.relaxing) < 0 or sum(self.relaxing) >= 1:
            raise ValueError(
                f"relaxing {list(self.relaxing)}: give parts from 0 that are below 1 together"
            )
        if not all(0.1 <= time <= 36_000 for time in self.relaxation_times):
            raise ValueError(
                f"relaxation_times {list(self.relaxation_times)}: give 0.1 to 36000 s each"
            )
        return self

    def per_cable(self) -> dict[str, Any]:
        """Numbers that can be one each, by key."""
        return {
            "mismatch.angle_errors_deg": self.angle_errors_deg,
            "mismatch.radius_errors": self.radius_errors,
        }

    @property
    def rest_bend(self) -> np.ndarray:
        """Bend without any force [rad], module frame, shape (2,)."""
        azimuth = np.deg2rad(self.rest_azimuth_deg)
        return np.deg2rad(self.rest_bend_deg) * np.array(
            [np.cos(azimuth), np.sin(azimuth)]
        )
