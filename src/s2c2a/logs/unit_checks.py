"""Units of a map that contradict the sizes in it, or those of any arm."""

import numpy as np
from jaxtyping import Float

from s2c2a.files.tables import METERS
from s2c2a.logs.log_map import ROTATING_UNITS, LogMap
from s2c2a.logs.take import drive_scale

# units differ by 2.5 or more; identified sizes, and stated ones, are rarely that wrong
SIZE_RATIO = 2.2
# a size that the map does not state is in this range, or its unit is wrong [m]
LENGTHS = (0.005, 2.0)  # of a module
SMALLEST_RADIUS = 0.0015  # of the cables, as in arm files; the largest is a module


def end_unit_change(lengths: Float[np.ndarray, " modules"], log_map: LogMap) -> str:
    """Unit of the ends in which the identified lengths are possible; empty: as given.

    Args:
        lengths: identified lengths of the modules, in the units of the map [m].
        log_map: the map.
    """
    arm = log_map.arm
    stated = arm.length
    if arm.lengths:
        stated = sum(arm.lengths)
    total = float(lengths.sum())
    low, high = np.array(LENGTHS) * arm.modules
    unit = log_map.ends[0].unit
    size_in_unit = total / METERS[unit]
    sizes = {name: size_in_unit * METERS[name] for name in METERS}
    best = _better_unit(total, sizes, stated, low, high)
    if not best:
        return ""
    reason = f"the stated {stated:.3g} m" if stated else f"{sizes[best]:.2g} m"
    return (
        f'write unit = "{best}" for the ends; in {unit}, the arm would be {total:.2g} m '
        f"long, not {reason}"
    )


def drive_unit_change(gain: float, length: float, log_map: LogMap) -> str:
    """Unit of the drives in which the cables are in a possible place.

    Args:
        gain: identified bend per meter of cable [rad/m]; its inverse is the radius.
        length: length of the shortest module [m].
        log_map: the map.
    """
    unit = log_map.drives[0].unit
    if unit == "free" or log_map.by_force:
        return ""
    stated = log_map.arm.cable_radius
    radii = _radii(1 / gain, log_map)
    best = _better_unit(1 / gain, radii, stated, SMALLEST_RADIUS, length)
    if not best:
        return ""
    # a radius of other cables shows alike
    other = ", or correct arm.cable_radius" if stated else ""
    return (
        f'write unit = "{best}" for the drives{other}; in {unit}, the cables would be '
        f"{1e3 / gain:.3g} mm from the center line, not {1e3 * radii[best]:.3g} mm"
    )


def _better_unit(
    given: float, sizes: dict[str, float], stated: float | None, low: float, high: float
) -> str:
    """The likeliest unit; empty if the given size is possible, or none in this unit.

    Args:
        given: identified size in the unit of the map [m].
        sizes: the same in every unit [m].
        stated: what the map states of it [m].
        low: smallest size [m], where nothing is stated.
        high: largest size [m], likewise.
    """
    if stated:
        low = stated / SIZE_RATIO
        high = stated * SIZE_RATIO
    target = np.sqrt(low * high)
    best = min(sizes, key=lambda unit: abs(np.log(sizes[unit] / target)))
    return "" if low < given < high or not low < sizes[best] < high else best


def _radii(radius: float, log_map: LogMap) -> dict[str, float]:
    """Radius of the cables [m] with each unit of the same kind."""
    drive = log_map.drives[0]
    units = ROTATING_UNITS if drive.unit in ROTATING_UNITS else tuple(METERS)
    scale = drive_scale(drive, log_map)
    return {
        unit: radius
        * drive_scale(drive.model_copy(update={"unit": unit}), log_map)
        / scale
        for unit in units
    }
