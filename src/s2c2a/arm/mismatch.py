"""Model mismatch: true parameters of a simulated arm that controllers do not know."""

from typing import Annotated

from pydantic import model_validator

from s2c2a.arm.fields import (
    ERROR,
    SHARE,
    Free,
    Frozen,
    Number,
    Numbers,
    Within,
    absent,
    between,
    optional,
)

RELAXATION_TIMES = (2.0, 20.0)  # s


class Mismatch(Frozen):
    """Mismatch between the nominal and the true parameters of one module.

    The other values of a module are nominal: geometry, estimators, models and planners
    use them only. The simulation alone reads this table. All mismatch is zero by
    default.
    """

    angle_errors_deg: Annotated[Numbers, Within(-45, 45)] = absent(
        "errors of cable_angles_deg [deg]"
    )
    radius_errors: Annotated[Numbers, Within(-0.5, 0.5)] = absent(
        "relative errors of cable_radius [1]"
    )
    coupling: Number | None = SHARE.key(
        "radius of its cables in the modules below, relative to cable_radius; "
        "default: in tubes",
        None,
    )
    mass_error: Number = ERROR.key("relative error of the mass", 0.0)
    stiffness_error: Number = ERROR.key("relative error of EI and GJ", 0.0)
    stiffness_ratio: Number = between(
        0.1,
        10,
        "1",
        "EI in the stiff direction over EI across it; the geometric mean is EI",
        1.0,
    )
    stiff_direction_deg: Free = absent(
        "azimuth of the stiff direction, from x to y [deg]"
    )
    hardening: Number = between(
        0,
        5,
        "1",
        (
            "relative stiffness increase at full bend, quadratic in the bend about "
            "each axis"
        ),
        0.0,
    )
    relaxing: tuple[Number, Number] = optional(
        "shares of the stiffness that relax, with a sum below 1 [1]", (0.0, 0.0)
    )
    relaxation_times: tuple[Free, Free] = optional(
        "time constants of the two shares [s]", RELAXATION_TIMES
    )
    axial_stiffness: Number | None = between(
        10,
        1e7,
        "N",
        "EA against shortening by cable tension; default: no shortening",
        None,
    )
    rest_bend_deg: Number = between(0, 90, "deg", "bend without any force", 0.0)
    rest_azimuth_deg: Free = absent("azimuth of that bend, from x to y [deg]")
    drift: Number = between(
        -0.5, 0.5, "1", "share of motor motion that is lost once the arm has aged", 0.0
    )

    @model_validator(mode="after")
    def _validate(self):
        if min(self.relaxing) < 0 or sum(self.relaxing) >= 1:
            raise ValueError(
                f"relaxing {list(self.relaxing)}: give shares from 0 that are below 1 "
                "together"
            )
        if min(self.relaxation_times) <= 0:
            raise ValueError(
                f"relaxation_times {list(self.relaxation_times)}: give times above 0 s"
            )
        return self
