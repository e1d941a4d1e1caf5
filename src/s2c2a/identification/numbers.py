"""Which numbers of an arm file are fitted, how far they may be from what the file says, and where they end."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from pydantic import BaseModel

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError

Path = tuple[str | int, ...]
EACH = "*"
# EA over EI / radius^2; a solid rod as thick as its cables are apart has 4
HARDLY_SHORTER = 20.0


@dataclass(frozen=True)
class Kind:
    """Numbers of one kind.

    Attributes:
        group: the word by which a user asks for them.
        key: where they stand in an arm file, dotted; `*` for every module, cable or
            component.
        spread: how far one may be from what the file says, as a standard deviation, in
            its unit; of its logarithm if `ratio`.
        low: least value.
        high: largest value.
        ratio: whether it is fitted as a ratio to what the file says.
        only_moving: whether it cannot be seen in an arm that rests.
    """

    group: str
    key: str
    spread: float
    low: float
    high: float
    ratio: bool = False
    only_moving: bool = False


KINDS = (
    Kind("stiffness", "modules.*.bending_stiffness", 0.7, 0.0005, 50, ratio=True),
    # of its logarithm
    Kind("axes", "modules.*.mismatch.stiffness_ratio.*", 0.2, -2.3, 2.3),
    Kind("hardening", "modules.*.mismatch.hardening", 0.3, 0, 5),
    Kind("cables", "modules.*.cable.stiffness", 1.0, 50, 1e6, ratio=True),
    Kind("cables", "modules.*.pretension", 20.0, 0, 500),
    Kind("routing", "modules.*.cable_angles_deg.*", 10.0, -3600, 3600),
    Kind("routing", "modules.*.cable_radius", 0.2, 0.0015, 0.3, ratio=True),
    Kind("routing", "modules.*.length", 0.2, 0.005, 2, ratio=True),
    Kind("routing", "modules.*.mismatch.coupling", 0.3, 0, 1),
    Kind("radii", "modules.*.mismatch.radius_errors.*", 0.1, -0.5, 0.5),
    Kind("backlash", "modules.*.cable.backlash.*", 0.0005, 0, 0.02),
    Kind("friction", "modules.*.cable.friction", 0.1, 0, 1),
    Kind("creep", "modules.*.cable.creep", 0.1, 0, 0.9, only_moving=True),
    Kind("mass", "modules.*.mass", 0.5, 0.0005, 10, ratio=True),
    Kind("rest", "modules.*.mismatch.rest_bend_deg.*", 5.0, -90, 90),
    Kind("shortening", "modules.*.mismatch.axial_stiffness", 1.5, 10, 1e7, ratio=True),
    Kind(
        "damping", "modules.*.damping_time", 0.7, 0.005, 2, ratio=True, only_moving=True
    ),
    Kind("motor", "motor.time_constant", 0.05, 0, 1, only_moving=True),
)
GROUPS = tuple(dict.fromkeys(kind.group for kind in KINDS))
USUAL = tuple(group for group in GROUPS if group not in ("axes", "hardening", "radii"))
"""Fitted where nothing else is asked for: without numbers that few recordings tell from
the others."""


@dataclass(frozen=True)
class Turned:
    """A size and a direction in an arm file, fitted as the two components of a vector, which knows no seam.

    Attributes:
        size: key of the size, whose place the components take.
        direction: key of the direction [deg].
        times: turns of the vector in one of the direction: two where opposite
            directions are the same.
        of_logarithm: whether the vector is as long as the size's logarithm.
    """

    size: str
    direction: str
    times: int = 1
    of_logarithm: bool = False

    def vector(self, size: float, direction: float) -> list[float]:
        """The two components."""
        long = math.log(size) if self.of_logarithm else size
        angle = self.times * math.radians(direction)
        return [long * math.cos(angle), long * math.sin(angle)]

    def size_and_direction(self, vector: Sequence[float]) -> tuple[float, float]:
        """The other way."""
        x, y = vector
        long = math.hypot(x, y)
        angle = math.degrees(math.atan2(y, x)) / self.times
        return math.exp(long) if self.of_logarithm else long, angle


TURNED = (
    Turned("rest_bend_deg", "rest_azimuth_deg"),
    Turned("stiffness_ratio", "stiff_direction_deg", times=2, of_logarithm=True),
)


@dataclass(frozen=True)
class Unknown:
    """One number of one arm.

    Its coordinate u is zero at what the file says, one a spread away: `start + spread
    u`, or `start exp(spread u)`.

    Attributes:
        path: where it stands in the arm file.
        kind: what it is.
        start: what the file says.
    """

    path: Path
    kind: Kind
    start: float

    @property
    def name(self) -> str:
        """Such as `modules.0.cable.backlash`."""
        return ".".join(map(str, self.path))

    def value(self, coordinate: float) -> float:
        """The number at a coordinate."""
        moved = self.kind.spread * coordinate
        value = self.start * np.exp(moved) if self.kind.ratio else self.start + moved
        return float(np.clip(value, self.kind.low, self.kind.high))

    def coordinate(self, value: float) -> float:
        """The coordinate of a number."""
        moved = np.log(value / self.start) if self.kind.ratio else value - self.start
        return float(moved / self.kind.spread)

    def slope(self, coordinate: float) -> float:
        """What the number changes by for a unit of the coordinate."""
        return self.kind.spread * (self.value(coordinate) if self.kind.ratio else 1.0)

    @property
    def bounds(self) -> tuple[float, float]:
        """Least and largest coordinate."""
        return self.coordinate(self.kind.low), self.coordinate(self.kind.high)


def stated_for(arm: ArmSpec, groups: Iterable[str]) -> ArmSpec:
    """The arm with a start for what its file leaves out and a group fits: a body that hardly shortens."""
    if "shortening" not in groups:
        return arm
    table = arm.model_dump(mode="json")
    for module, written in zip(arm.modules, table["modules"], strict=True):
        if module.mismatch.axial_stiffness is None:
            stiff = HARDLY_SHORTER * module.bending_stiffness / module.cable_radius**2
            written["mismatch"] = written.get("mismatch", {}) | {
                "axial_stiffness": float(np.clip(stiff, 10, 1e7))
            }
    return ArmSpec.model_validate(table)


def unknowns_of(
    arm: ArmSpec, groups: Iterable[str] = USUAL, moving: bool = True
) -> tuple[Unknown, ...]:
    """The numbers of an arm file that are fitted: those of some groups that it states or has a default for.

    Args:
        arm: the start.
        groups: words of `GROUPS`.
        moving: whether the recording shows the arm in motion, not only at rest.

    Raises:
        S2C2AError: no such group, or nothing to fit.
    """
    asked = tuple(groups)
    if wrong := sorted(set(asked) - set(GROUPS)):
        raise S2C2AError(
            f"nothing to fit is called {', '.join(wrong)}; choose from {', '.join(GROUPS)}"
        )
    table = _table_of(arm)
    kinds = [
        kind
        for kind in KINDS
        if kind.group in asked and (moving or not kind.only_moving)
    ]
    every = (
        Unknown(path, kind, value)
        for kind in kinds
        for path, value in _matching(table, kind.key.split("."), ())
    )
    found = tuple(one for one in every if _shows(arm, one))
    if not found:
        raise S2C2AError(
            f"{arm.name} has no number of {', '.join(asked) or 'no group'} that this recording can show"
        )
    return found


def _shows(arm: ArmSpec, unknown: Unknown) -> bool:
    """A ratio needs a start that is not zero, weight needs gravity, and tensions know no displacement."""
    if (
        arm.actuation == "tension"
        and unknown.path[-2:-1] == ("cable",)
        and unknown.path[-1] != "friction"
    ):
        return False
    if unknown.kind.group == "backlash" and arm.actuation == "tension":
        return False
    if unknown.kind.group == "mass" and not any(arm.gravity_direction):
        return False
    return not unknown.kind.ratio or unknown.start > 0


def arm_at(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    coordinates: Float[np.ndarray, " unknowns"],
) -> ArmSpec:
    """The arm with its unknown numbers at these coordinates.

    Raises:
        ValidationError: they are no possible arm together.
    """
    table = _table_of(arm)
    for unknown, coordinate in zip(unknowns, coordinates, strict=True):
        place: Any = table
        for step in unknown.path[:-1]:
            place = place[step]
        place[unknown.path[-1]] = unknown.value(coordinate)
    return ArmSpec.model_validate(_as_written(table))


def _table_of(arm: ArmSpec) -> dict[str, Any]:
    """All that can stand in its file, defaults too, one number a cable, and vectors in place of directions."""
    table = _plain(arm)
    for module in table["modules"]:
        cables = len(module["cable_angles_deg"])
        for part, key in (
            (module["cable"], "backlash"),
            (module["mismatch"], "radius_errors"),
        ):
            part[key] = list(np.broadcast_to(part[key], cables).astype(float))
        for one in TURNED:
            module["mismatch"][one.size] = one.vector(
                module["mismatch"][one.size], module["mismatch"][one.direction]
            )
    return table


def _as_written(table: dict[str, Any]) -> dict[str, Any]:
    """As an arm file has it; one number where all cables have the same."""
    for module in table["modules"]:
        mismatch = module["mismatch"]
        for one in TURNED:
            mismatch[one.size], mismatch[one.direction] = one.size_and_direction(
                mismatch[one.size]
            )
        for part, key in ((module["cable"], "backlash"), (mismatch, "radius_errors")):
            part[key] = part[key] if len(set(part[key])) > 1 else part[key][0]
    return table


def _plain(value: Any) -> Any:
    """Tables and lists of what a description holds."""
    if isinstance(value, BaseModel):
        return {name: _plain(getattr(value, name)) for name in type(value).model_fields}
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _matching(
    value: Any, rest: Sequence[str], path: Path
) -> Iterator[tuple[Path, float]]:
    """Numbers under a key with stars."""
    if not rest:
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield path, float(value)
    elif rest[0] == EACH:
        for place, one in enumerate(value):
            yield from _matching(one, rest[1:], (*path, place))
    else:
        yield from _matching(value[rest[0]], rest[1:], (*path, rest[0]))
