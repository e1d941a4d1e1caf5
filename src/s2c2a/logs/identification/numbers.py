"""Numbers of an arm file that can be fitted, with their priors and bounds."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from pydantic import BaseModel

from s2c2a.arm import ArmSpec
from s2c2a.arm.fields import FORCE, LENGTH, LOST_MOTION, MASS, RIGIDITY
from s2c2a.errors import S2C2AError, did_you_mean
from s2c2a.files.text import LARGEST
from s2c2a.models.statics import INITIAL_STIFFNESS

Path = tuple[str | int, ...]
EACH = "*"
# EA over EI / radius^2 of an arm that hardly shortens; a solid rod whose radius is that
# of its cables has 4
STIFF_AXIAL_RATIO = 20.0
MIN_STIFFNESS = 50.0  # N/m, of cables; what an arm file allows
MIN_AXIAL_STIFFNESS = 10.0  # N
MAX_AXIAL_STIFFNESS = 1e7  # N


@dataclass(frozen=True)
class Kind:
    """Numbers of one kind.

    Attributes:
        group: name of their group on the command line.
        key: dotted key in an arm file, with `*` for every module, cable, or component.
        spread: prior standard deviation about the file's value, in its unit; of the
            logarithm if `ratio`.
        low: smallest value.
        high: largest value.
        ratio: whether it is fitted as a ratio to the file's value.
        only_moving: whether it has no effect on an arm at rest.
    """

    group: str
    key: str
    spread: float
    low: float
    high: float
    ratio: bool = False
    only_moving: bool = False


KINDS = (
    Kind(
        "stiffness",
        "modules.*.bending_stiffness",
        0.7,
        RIGIDITY.low,
        RIGIDITY.high,
        ratio=True,
    ),
    # components of the logarithm
    Kind("axes", "modules.*.mismatch.stiffness_ratio.*", 0.2, -2.3, 2.3),
    Kind("hardening", "modules.*.mismatch.hardening", 0.3, 0, 5),
    Kind("cables", "modules.*.cable.stiffness", 1.0, MIN_STIFFNESS, 1e6, ratio=True),
    Kind("cables", "modules.*.pretension", 20.0, 0, FORCE.high),
    Kind("routing", "modules.*.cable_angles_deg.*", 10.0, -LARGEST, LARGEST),
    Kind("routing", "modules.*.cable_radius", 0.2, LENGTH.low, LENGTH.high, ratio=True),
    Kind("routing", "modules.*.length", 0.2, LENGTH.low, LENGTH.high, ratio=True),
    Kind("routing", "modules.*.mismatch.coupling", 0.3, 0, 1),
    Kind("radii", "modules.*.mismatch.radius_errors.*", 0.1, -0.5, 0.5),
    Kind(
        "backlash",
        "modules.*.cable.backlash.*",
        0.0005,
        LOST_MOTION.low,
        LOST_MOTION.high,
    ),
    Kind("friction", "modules.*.cable.friction", 0.1, 0, 1),
    Kind("creep", "modules.*.cable.creep", 0.1, 0, 0.9, only_moving=True),
    Kind("mass", "modules.*.mass", 0.5, MASS.low, MASS.high, ratio=True),
    Kind("tip", "tip.mass", 0.05, 0, MASS.high),
    Kind("rest", "modules.*.mismatch.rest_bend_deg.*", 5.0, -90, 90),
    Kind(
        "shortening",
        "modules.*.mismatch.axial_stiffness",
        1.5,
        MIN_AXIAL_STIFFNESS,
        MAX_AXIAL_STIFFNESS,
        ratio=True,
    ),
    Kind(
        "damping", "modules.*.damping_time", 0.7, 0.005, 2, ratio=True, only_moving=True
    ),
    Kind("motor", "motor.time_constant", 0.05, 0, 1, only_moving=True),
)
GROUPS = tuple(dict.fromkeys(kind.group for kind in KINDS))
UNUSUAL = ("axes", "hardening", "radii", "tip")
USUAL = tuple(group for group in GROUPS if group not in UNUSUAL)
"""Groups that are fitted by default: those that most recordings determine."""


@dataclass(frozen=True)
class PolarKeys:
    """Size and direction in an arm file, fitted as the two components of a vector.

    Components are continuous where a direction jumps by a turn.

    Attributes:
        size: key of the size, which the components replace.
        direction: key of the direction [deg].
        symmetry: turns of the vector per turn of the direction: two where opposite
            directions are equal.
        logarithmic: whether the length of the vector is the logarithm of the size.
    """

    size: str
    direction: str
    symmetry: int = 1
    logarithmic: bool = False

    def to_components(self, table: dict[str, Any]) -> None:
        """Replace the size by the components."""
        length = table[self.size]
        if self.logarithmic:
            length = math.log(length)
        angle = self.symmetry * math.radians(table[self.direction])
        across = length * math.sin(angle)
        table[self.size] = [length * math.cos(angle), across]

    def to_polar(self, table: dict[str, Any]) -> None:
        """Replace the components by the size and the direction."""
        x, y = table[self.size]
        length = math.hypot(x, y)
        table[self.size] = math.exp(length) if self.logarithmic else length
        angle = math.atan2(y, x)
        table[self.direction] = math.degrees(angle) / self.symmetry


POLAR_KEYS = (
    PolarKeys("rest_bend_deg", "rest_azimuth_deg"),
    PolarKeys("stiffness_ratio", "stiff_direction_deg", symmetry=2, logarithmic=True),
)


@dataclass(frozen=True)
class Unknown:
    """One number of one arm.

    Its coordinate u is zero at the file's value and one a prior standard deviation
    above it: `start + spread u`, or `start exp(spread u)`.

    Attributes:
        path: keys and indices in the arm file.
        kind: kind of the number.
        start: value in the file.
    """

    path: Path
    kind: Kind
    start: float

    @property
    def name(self) -> str:
        """Dotted path, such as `modules.0.cable.backlash`."""
        return ".".join(map(str, self.path))

    def value(self, coordinate: float) -> float:
        """Value at a coordinate."""
        change = self.kind.spread * coordinate
        value = self.start + change
        if self.kind.ratio:
            value = self.start * np.exp(change)
        return float(np.clip(value, self.kind.low, self.kind.high))

    def coordinate(self, value: float) -> float:
        """Coordinate of a value."""
        change = value - self.start
        if self.kind.ratio:
            change = np.log(value / self.start)
        return float(change / self.kind.spread)

    def slope(self, coordinate: float) -> float:
        """Derivative of the value by the coordinate."""
        return self.kind.spread * (self.value(coordinate) if self.kind.ratio else 1.0)

    @property
    def bounds(self) -> tuple[float, float]:
        """Smallest and largest coordinate."""
        return self.coordinate(self.kind.low), self.coordinate(self.kind.high)


def with_default_starts(arm: ArmSpec, groups: Iterable[str]) -> ArmSpec:
    """Arm with a start for numbers that a group fits and its file lacks.

    The axial stiffness starts at that of an arm that hardly shortens, and that of cables
    where training starts: no fit leaves cables that hardly yield.
    """
    table = arm.model_dump(mode="json")
    has_cables = "cables" in groups and arm.actuation == "displacement"
    for module, values in zip(arm.modules, table["modules"], strict=True):
        tension = module.bending_stiffness / module.cable_radius**2  # EI / r^2
        if "shortening" in groups and module.mismatch.axial_stiffness is None:
            stiff = STIFF_AXIAL_RATIO * tension
            stiff = np.clip(stiff, MIN_AXIAL_STIFFNESS, MAX_AXIAL_STIFFNESS)
            values.setdefault("mismatch", {})["axial_stiffness"] = float(stiff)
        stated = module.cable.model_fields_set
        if has_cables and "stiffness" not in stated:
            yielding = INITIAL_STIFFNESS * tension / module.length
            yielding = np.clip(yielding, MIN_STIFFNESS, module.cable.stiffness)
            values.setdefault("cable", {})["stiffness"] = float(yielding)
    return ArmSpec.model_validate(table)


def unknowns_of(
    arm: ArmSpec, groups: Iterable[str] = USUAL, moving: bool = True
) -> tuple[Unknown, ...]:
    """Numbers of some groups that an arm file states or has a default for.

    Args:
        arm: start of the fit.
        groups: names in `GROUPS`.
        moving: whether the recording shows the arm in motion, not only at rest.

    Raises:
        S2C2AError: a group does not exist, or there is nothing to fit.
    """
    groups = tuple(groups)
    wrong = sorted(set(groups) - set(GROUPS))
    if wrong:
        raise S2C2AError(
            f"{', '.join(wrong)}: no such group of numbers"
            f"{did_you_mean(wrong[0], GROUPS)}; "
            f"choose from {', '.join(GROUPS)}"
        )
    table = _table_of(arm)
    unknowns = []
    for kind in KINDS:
        if kind.group not in groups or (kind.only_moving and not moving):
            continue
        for path, value in _match(table, kind.key.split("."), ()):
            unknown = Unknown(path, kind, value)
            if _has_effect(arm, unknown):
                unknowns.append(unknown)
    if not unknowns:
        raise S2C2AError(
            f"{arm.name} has no number of {', '.join(groups) or 'no group'} that this "
            f"recording can show; choose from {', '.join(GROUPS)}"
        )
    return tuple(unknowns)


def _has_effect(arm: ArmSpec, unknown: Unknown) -> bool:
    """Whether a number can be fitted.

    A ratio needs a start above zero, a mass needs gravity, and of the cables of an arm
    driven by tension only the friction has an effect.
    """
    is_cable = unknown.kind.group == "backlash" or unknown.path[-2:-1] == ("cable",)
    if arm.actuation != "displacement" and is_cable and unknown.path[-1] != "friction":
        return False
    if unknown.path[-1] == "mass" and not any(arm.gravity_direction):
        return False
    return not unknown.kind.ratio or unknown.start > 0


def arm_at(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    coordinates: Float[np.ndarray, " unknowns"],
) -> ArmSpec:
    """Arm with its unknown numbers at these coordinates.

    Raises:
        ValidationError: the numbers together are not a valid arm.
    """
    table = _table_of(arm)
    for unknown, coordinate in zip(unknowns, coordinates, strict=True):
        entry: Any = table
        for key in unknown.path[:-1]:
            entry = entry[key]
        entry[unknown.path[-1]] = unknown.value(coordinate)
    _undo_expansion(table)
    return ArmSpec.model_validate(table)


def _per_cable_entries(
    module: dict[str, Any],
) -> tuple[tuple[dict[str, Any], str], ...]:
    """Tables and keys of numbers that may be given once for all cables."""
    return (module["cable"], "backlash"), (module["mismatch"], "radius_errors")


def _table_of(arm: ArmSpec) -> dict[str, Any]:
    """All keys of an arm file, with a number per cable and components of vectors."""
    table = _to_plain(arm)
    for module in table["modules"]:
        cables = len(module["cable_angles_deg"])
        for entry, key in _per_cable_entries(module):
            if cables:
                entry[key] = list(np.broadcast_to(entry[key], cables).astype(float))
        for keys in POLAR_KEYS:
            keys.to_components(module["mismatch"])
    return table


def _undo_expansion(table: dict[str, Any]) -> None:
    """Restore directions, and one number where all cables have the same."""
    for module in table["modules"]:
        for keys in POLAR_KEYS:
            keys.to_polar(module["mismatch"])
        for entry, key in _per_cable_entries(module):
            if module["cable_angles_deg"] and len(set(entry[key])) == 1:
                entry[key] = entry[key][0]


def _to_plain(value: Any) -> Any:
    """Dictionaries and lists of a description."""
    if isinstance(value, BaseModel):
        names = type(value).model_fields
        return {name: _to_plain(getattr(value, name)) for name in names}
    if isinstance(value, tuple):
        return [_to_plain(item) for item in value]
    return value


def _match(value: Any, keys: Sequence[str], path: Path) -> Iterator[tuple[Path, float]]:
    """Paths and values of the numbers under a key with stars."""
    if not keys:
        if isinstance(value, int | float) and not isinstance(value, bool):
            yield path, float(value)
        return
    key, *rest = keys
    if key != EACH:
        yield from _match(value[key], rest, (*path, key))
        return
    for index, item in enumerate(value):
        yield from _match(item, rest, (*path, index))
