"""Which numbers of an arm file are fitted, how far they may be from what the file says, and where they end."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError

Path = tuple[str | int, ...]
EACH = "*"


@dataclass(frozen=True)
class Kind:
    """Numbers of one kind.

    Attributes:
        group: the word by which a user asks for them.
        key: where they stand in an arm file, dotted; `*` for every module, cable or component.
        spread: how far one may be from what the file says, as a standard deviation, in its unit; of its logarithm if
            `ratio`.
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
    Kind("stiffness", "modules.*.flaws.stiffness_ratio", 0.2, 0.1, 10, ratio=True),
    Kind("stiffness", "modules.*.flaws.hardening", 0.3, 0, 5),
    Kind("cables", "modules.*.cable.stiffness", 1.0, 50, 1e6, ratio=True),
    Kind("cables", "modules.*.pretension", 20.0, 0, 500),
    Kind("routing", "modules.*.cable_angles_deg.*", 10.0, -3600, 3600),
    Kind("routing", "modules.*.cable_radius", 0.2, 0.0015, 0.3, ratio=True),
    Kind("routing", "modules.*.length", 0.1, 0.005, 2, ratio=True),
    Kind("routing", "modules.*.flaws.radius_errors.*", 0.1, -0.5, 0.5),
    Kind("routing", "modules.*.flaws.coupling", 0.3, 0, 1),
    Kind("play", "modules.*.cable.play", 0.0005, 0, 0.02),
    Kind("play", "modules.*.cable.play.*", 0.0005, 0, 0.02),
    Kind("friction", "modules.*.cable.friction", 0.1, 0, 1),
    Kind("creep", "modules.*.cable.creep", 0.1, 0, 0.9),
    Kind("creep", "modules.*.cable.creep_time", 0.7, 0.1, 3600, ratio=True, only_moving=True),
    Kind("mass", "modules.*.mass", 0.3, 0.0005, 10, ratio=True),
    Kind("rest", "modules.*.flaws.rest_bend_deg", 5.0, 0, 90),
    Kind("rest", "modules.*.flaws.rest_azimuth_deg", 60.0, -3600, 3600),
    Kind("shortening", "modules.*.flaws.axial_stiffness", 1.0, 10, 1e7, ratio=True),
    Kind("damping", "modules.*.damping_time", 0.7, 0.005, 2, ratio=True, only_moving=True),
    Kind("motor", "motor.time_constant", 0.05, 0, 1, only_moving=True),
)
GROUPS = tuple(dict.fromkeys(kind.group for kind in KINDS))
USUAL = ("stiffness", "cables", "routing", "play", "friction", "creep", "mass", "rest", "shortening", "damping", "motor")


@dataclass(frozen=True)
class Unknown:
    """One number of one arm.

    Its coordinate u is zero at what the file says, one a spread away: `start + spread u`, or `start exp(spread u)`.

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
        """Such as `modules.0.cable.play`."""
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


def unknowns_of(arm: ArmSpec, groups: Iterable[str] = USUAL, moving: bool = True) -> tuple[Unknown, ...]:
    """The numbers of an arm file that are fitted: those of the groups that it states or has a default for.

    Args:
        arm: the start.
        groups: words of `GROUPS`.
        moving: whether the recording shows the arm in motion, not only at rest.

    Raises:
        S2C2AError: no such group, or nothing to fit.
    """
    asked = tuple(groups)
    if wrong := sorted(set(asked) - set(GROUPS)):
        raise S2C2AError(f"nothing to fit is called {', '.join(wrong)}; choose from {', '.join(GROUPS)}")
    table = arm.model_dump(mode="json")
    kinds = [kind for kind in KINDS if kind.group in asked and (moving or not kind.only_moving)]
    found = tuple(
        Unknown(path, kind, value) for kind in kinds for path, value in _matching(table, kind.key.split("."), ())
    )
    if not found:
        raise S2C2AError(f"{arm.name} has no number of {', '.join(asked) or 'no group'} that this recording can show")
    return tuple(one for one in found if _seen_by(arm, one))


def _seen_by(arm: ArmSpec, unknown: Unknown) -> bool:
    """Weight needs gravity; a ratio needs a start that is not zero; displacement has what tension has not."""
    if unknown.kind.ratio and unknown.start <= 0:
        return False
    if unknown.kind.group == "mass" and not any(arm.gravity_direction):
        return not unknown.kind.only_moving
    tension = arm.actuation == "tension"
    return not (tension and unknown.kind.key.split(".cable.")[-1] in ("stiffness", "play", "creep", "creep_time"))


def _matching(value: Any, rest: Sequence[str], path: Path) -> Iterator[tuple[Path, float]]:
    """Numbers under a key with stars."""
    if not rest:
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield path, float(value)
        return
    if rest[0] == EACH and isinstance(value, list | tuple):
        for place, one in enumerate(value):
            yield from _matching(one, rest[1:], (*path, place))
    elif isinstance(value, dict) and rest[0] in value:
        yield from _matching(value[rest[0]], rest[1:], (*path, rest[0]))


def arm_at(arm: ArmSpec, unknowns: Sequence[Unknown], coordinates: Float[np.ndarray, " unknowns"]) -> ArmSpec:
    """The arm with its unknown numbers at these coordinates.

    Raises:
        ValidationError: they are no possible arm together.
    """
    table = arm.model_dump(mode="json")
    for unknown, coordinate in zip(unknowns, coordinates, strict=True):
        place = table
        for step in unknown.path[:-1]:
            place = place[step]
        place[unknown.path[-1]] = unknown.value(coordinate)
    return ArmSpec.model_validate(table)
