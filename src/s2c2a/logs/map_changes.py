"""Single changes of a map under which its statements equal what a log shows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm.geometry import directions_at
from s2c2a.logs.cable_model import tilt_rotation
from s2c2a.logs.cable_search import Assignment, is_symmetric
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.model_fit import CableFit
from s2c2a.logs.priors import stated_angles, without_turn
from s2c2a.logs.take import unit_vector

# above the error of identified angles (15 deg in tests); a third of a right angle, by
# which frames and cables are confused
TOLERANCE_DEG = 30.0
OTHER_LENGTHS = 1.2, 0.8  # times the stated ones: errors that are to be noticed
PLACE = ("module", "angle_deg")  # keys of a drive
AXES = ("x", "y", "z", "-x", "-y", "-z")
Change = tuple[str, LogMap]
"""Clause that says what changes, and the changed map."""


@dataclass(frozen=True)
class Identified:
    """What a fit identifies.

    Attributes:
        modules: module of each motor, shape (drives,).
        signs: 1 where a larger number pulls, shape (drives,).
        directions: directions of the bends that larger numbers cause, frame of the log,
            shape (drives, 3).
        z: direction along the arm, frame of the log.
        lengths: lengths of the modules [m].
        gain: bend per meter of cable [rad/m].
        order: indices of the ends from the base to the tip.
    """

    modules: np.ndarray
    signs: np.ndarray
    directions: Float[np.ndarray, "drives 3"]
    z: Float[np.ndarray, "3"]
    lengths: Float[np.ndarray, " modules"]
    gain: float
    order: np.ndarray

    @classmethod
    def of(
        cls,
        fit: CableFit,
        assignment: Assignment,
        axes: np.ndarray,
        scale: float = 1.0,
        order: np.ndarray | None = None,
    ) -> "Identified":
        """Values of a fit to ends divided by a scale, in an order."""
        parameters = fit.parameters
        axes = axes @ np.asarray(tilt_rotation(parameters.tilt))
        across = directions_at(np.asarray(parameters.angles)) @ axes[:, :2].T
        return cls(
            assignment.modules,
            assignment.signs,
            assignment.signs[:, None] * across,
            axes[:, 2],
            scale * np.exp(np.asarray(parameters.lengths)),
            float(np.exp(parameters.gain)),
            np.arange(0) if order is None else order,
        )

    def transformed(self, columns: np.ndarray) -> "Identified":
        """The same, with other columns of the positions."""
        return replace(self, directions=self.directions @ columns.T, z=columns @ self.z)


def contradicts_angles(found: Identified, log_map: LogMap) -> bool:
    """Whether an identified angle is far from the stated one."""
    errors = _angle_errors(found, log_map)
    return errors is None or bool((errors > np.deg2rad(TOLERANCE_DEG)).any())


def describe_angles(found: Identified, log_map: LogMap) -> str:
    """Sentence that names drives whose identified angle is far from the stated one."""
    errors = _angle_errors(found, log_map)
    if errors is None:
        return ""
    names = [
        f"'{drive.name}' by {error:.0f} deg"
        for drive, error in zip(log_map.drives, np.rad2deg(errors), strict=True)
        if error > TOLERANCE_DEG
    ]
    if not names:
        return ""
    return (
        f"the log contradicts stated angles: {', '.join(names)}; check module, angle_deg "
        "and positive of these drives, and that the frame of the ends is right-handed"
    )


def find_changes(found: Identified, log_map: LogMap) -> list[str]:
    """Clauses of the single changes, each of which explains all; empty if none does."""
    if _agrees(found, log_map):
        return []
    frames = [
        clause
        for clause, columns, changed in _frame_changes(log_map)
        if _agrees(found.transformed(columns), changed)
    ]
    angles = [
        clause
        for clause, changed in (angles_from_radians(log_map), clockwise_angles(log_map))
        if _agrees(found, changed)
    ]
    return [
        *angles,
        *frames,
        *_drive_changes(found, log_map),
        *_module_changes(found, log_map),
        *_end_changes(found, log_map),
        *_sign_changes(found, log_map),
    ]


def _agrees(found: Identified, log_map: LogMap) -> bool:
    """Whether all statements about frame, ends, and drives hold."""
    return (
        not contradicts_angles(found, log_map)
        and _modules_agree(found, log_map)
        and _is_sorted(found, log_map)
        and not _are_reversed(found, log_map)
    )


def _modules_agree(found: Identified, log_map: LogMap) -> bool:
    stated = [drive.module for drive in log_map.drives]
    pairs = zip(stated, found.modules, strict=True)
    return all(one is None or one == other for one, other in pairs)


def _is_sorted(found: Identified, log_map: LogMap) -> bool:
    modules = np.array(log_map.end_modules)[found.order]
    return bool((np.diff(modules) > 0).all())


def _are_reversed(found: Identified, log_map: LogMap) -> bool:
    stated = signs_of(log_map)
    known = stated != 0
    are_opposed = found.signs[known] == -stated[known]
    return bool(known.any() and are_opposed.all())


def signs_of(log_map: LogMap) -> np.ndarray:
    """Stated signs of the drives; 0 where it is unknown."""
    return np.array([drive.sign for drive in log_map.drives])


def angles_of(log_map: LogMap) -> Float[np.ndarray, " drives"]:
    """Stated angles [rad]; NaN where the angle or the sign of a motor is free."""
    return np.where(signs_of(log_map) == 0, np.nan, stated_angles(log_map))


def _angle_errors(found: Identified, log_map: LogMap) -> np.ndarray | None:
    """Errors of stated angles [rad], zero where none is; None: `along` is wrong."""
    frame = log_map.frame
    z = found.z
    if frame.along is not None:
        z = unit_vector(frame.along)
    tolerance = np.deg2rad(TOLERANCE_DEG)
    if found.z @ z < np.cos(tolerance):
        return None
    x = np.eye(3)[np.argmin(np.abs(z))]
    if frame.x is not None:
        x = unit_vector(frame.x)
    x = x - (x @ z) * z
    size = np.linalg.norm(x)
    if size < 0.1:
        return None
    x = x / size
    y = np.cross(z, x)
    signs = signs_of(log_map)
    directions = found.directions * signs[:, None]
    angles = np.arctan2(directions @ y, directions @ x)
    stated = angles_of(log_map)
    errors = without_turn(angles - stated, log_map)
    return np.nan_to_num(np.abs(errors))


def _frame_changes(log_map: LogMap) -> Iterator[tuple[str, np.ndarray, LogMap]]:
    """Other columns, or another direction of the frame."""
    names = log_map.ends[0].position
    for axis, name in enumerate(names):
        columns = np.eye(3)
        columns[axis, axis] = -1.0
        text = f"the frame is left-handed: negate the column '{name}'"
        yield f"{text}{_of_others(log_map)}", columns, log_map
    for first, second in combinations(range(len(names)), 2):
        order = np.arange(3)
        order[[first, second]] = second, first
        text = f"exchange the columns '{names[first]}' and '{names[second]}'"
        yield f"{text}{_of_others(log_map)}", np.eye(3)[order], log_map
    for name in ("along", "x"):
        if getattr(log_map.frame, name) is None:
            continue
        for direction in AXES:
            frame = _with(log_map.frame, **{name: direction})
            changed = _with(log_map, frame=frame)
            yield f'write frame.{name} = "{direction}"', np.eye(3), changed


def _of_others(log_map: LogMap) -> str:
    return " of `position`, and those of other ends" if len(log_map.ends) > 1 else ""


def _drive_changes(found: Identified, log_map: LogMap) -> Iterator[str]:
    """Two drives exchanged: module and angle, or these and the effect of numbers."""
    for pair in combinations(range(len(log_map.drives)), 2):
        for keys in (PLACE, (*PLACE, "positive")):
            clause, changed = exchange_drives(pair, keys, log_map)
            if _agrees(found, changed):
                yield clause
                break


def exchange_drives(
    pair: tuple[int, int],
    keys: Sequence[str],
    log_map: LogMap,
) -> Change:
    """Clause, and the map in which two drives have exchanged values of some keys."""
    drives = list(log_map.drives)
    for one, other in (pair, pair[::-1]):
        values = {key: getattr(log_map.drives[other], key) for key in keys}
        drives[one] = _with(drives[one], **values)
    changed = _with(log_map, drives=tuple(drives))
    first, second = (log_map.drives[index].name for index in pair)
    return f"exchange {', '.join(keys)} of '{first}' and '{second}'", changed


def _module_changes(found: Identified, log_map: LogMap) -> Iterator[str]:
    """Stated modules of all drives, permuted."""
    order: dict[int, int] = {}
    for drive, module in zip(log_map.drives, found.modules, strict=True):
        if drive.module is not None:
            order.setdefault(drive.module, int(module))
    changed = _renumbered(log_map, order)
    wrong = sorted(old for old, new in order.items() if old != new)
    if wrong and _agrees(found, changed):
        yield "write " + ", ".join(
            f"module = {order[old]} for the drives with module = {old}" for old in wrong
        )


def _end_changes(found: Identified, log_map: LogMap) -> Iterator[str]:
    if _is_sorted(found, log_map):
        return
    modules = sorted(log_map.end_modules)
    ends = list(log_map.ends)
    texts = []
    for index, module in zip(found.order, modules, strict=True):
        if log_map.end_modules[index] != module:
            name = ends[index].position[0]
            texts.append(f"module = {module} for the end '{name}'")
        ends[index] = _with(ends[index], module=module)
    if _agrees(found, _with(log_map, ends=tuple(ends))):
        yield f"write {', '.join(texts)}"


def _sign_changes(found: Identified, log_map: LogMap) -> Iterator[str]:
    clause, changed = reversed_drives(log_map)
    if _are_reversed(found, log_map) and _agrees(found, changed):
        yield clause


def angles_from_radians(log_map: LogMap) -> Change:
    """Clause, and the map whose numbers of `angle_deg` are radians."""
    clause = "write angle_deg in degrees, not in radians"
    return clause, _scaled_angles(log_map, np.rad2deg(1.0))


def clockwise_angles(log_map: LogMap) -> Change:
    """Clause, and the map whose numbers of `angle_deg` count the other way round."""
    clause = "count angle_deg counterclockwise, seen from the tip towards the base"
    return clause, _scaled_angles(log_map, -1.0)


def _scaled_angles(log_map: LogMap, factor: float) -> LogMap:
    drives = tuple(
        _with(drive, angle_deg=drive.angle_deg and factor * drive.angle_deg)
        for drive in log_map.drives
    )
    return _with(log_map, drives=drives)


def unstated_angles(log_map: LogMap) -> LogMap:
    """The map that leaves the angles of drives to the log."""
    drives = tuple(_with(drive, angle_deg=None) for drive in log_map.drives)
    return _with(log_map, drives=drives)


def reversed_drives(log_map: LogMap) -> Change:
    """Clause, and the map in which every stated effect of a drive is the other one."""
    other = {"pulls": "releases", "releases": "pulls"}
    drives = []
    for drive in log_map.drives:
        # a pair that is reversed is one that is turned, and a pressure only pushes
        is_free = drive.angle_deg is None and is_symmetric(drive)
        if not drive.pushes and not is_free:
            drive = _with(drive, positive=other.get(drive.positive, drive.positive))
        drives.append(drive)
    changed = _with(log_map, drives=tuple(drives))
    return "reverse `positive` of each drive", changed


def reversed_modules(log_map: LogMap) -> Change:
    """Clause, and the map in which stated modules of drives count from the other end."""
    modules = range(log_map.arm.modules)
    numbers = dict(zip(modules, reversed(modules), strict=True))
    clause = "reverse the order of the drives' `module`, which is 0 at the base"
    return clause, _renumbered(log_map, numbers)


def _renumbered(log_map: LogMap, numbers: Mapping[Any, int]) -> LogMap:
    """The map with other numbers of the drives' modules, where they are stated."""
    drives = [_with(each, module=numbers.get(each.module)) for each in log_map.drives]
    return _with(log_map, drives=tuple(drives))


def unstated_lengths(log_map: LogMap) -> Change:
    """Clause, and the map that leaves the lengths of modules to the log."""
    arm = _with(log_map.arm, length=None, lengths=None)
    return "correct arm.length or arm.lengths, or leave it out", _with(log_map, arm=arm)


def unstated_sizes(log_map: LogMap) -> LogMap:
    """The map that leaves all that is in meters to the log, but the cables' travel."""
    _, changed = unstated_lengths(log_map)
    arm = _with(changed.arm, cable_radius=None)
    return _with(changed, arm=arm, frame=_with(log_map.frame, base=None))


def other_length(log_map: LogMap, factor: float) -> Change:
    """Clause, and the map of an arm so many times as long, if its length is stated."""
    arm = log_map.arm
    length = arm.length and factor * arm.length
    lengths = arm.lengths and tuple(factor * each for each in arm.lengths)
    other = _with(arm, length=length, lengths=lengths)
    return f"state an arm {factor:g} times as long", _with(log_map, arm=other)


def other_commands(log_map: LogMap) -> Change:
    """Clause, and the map whose rows are on the other side of their command."""
    commands = "sent" if log_map.rows.settled else "settled"
    rows = _with(log_map.rows, commands=commands)
    return f'write rows.commands = "{commands}"', _with(log_map, rows=rows)


def settled_rows(log_map: LogMap) -> Change:
    """Clause, and the map whose rows are settled poses."""
    rows = _with(log_map.rows, kind="steps")
    return 'write rows.kind = "steps"', _with(log_map, rows=rows)


def other_directions(log_map: LogMap, z: np.ndarray) -> list[Change]:
    """Clause and map with the `along` that the ends show, if another one is stated.

    Args:
        log_map: the map.
        z: direction along the arm that the ends show, frame of the log.
    """
    frame = log_map.frame
    if frame.along is None:
        return []
    shown = max(AXES, key=lambda axis: float(unit_vector(axis) @ z))
    direction = unit_vector(shown)
    if unit_vector(frame.along) @ direction > np.cos(np.deg2rad(2 * TOLERANCE_DEG)):
        return []
    clause = f'write frame.along = "{shown}"'
    if frame.x is not None:
        across = unit_vector(frame.x) @ direction
        if abs(across) > np.cos(np.deg2rad(TOLERANCE_DEG)):
            clause = f"{clause} and a frame.x across it"
    # an x that was chosen for another direction says nothing of this one
    return [(clause, _with(log_map, frame=_with(frame, along=shown, x=None)))]


def with_assignment(log_map: LogMap, assignment: Assignment) -> LogMap:
    """The map, which states modules and coupling of an assignment, too."""
    drives = tuple(
        _with(drive, module=int(module))
        for drive, module in zip(log_map.drives, assignment.modules, strict=True)
    )
    arm = _with(log_map.arm, coupled_cables=bool(assignment.coupled))
    return _with(log_map, drives=drives, arm=arm)


def _with(entry: Any, **values: Any) -> Any:
    return entry.model_copy(update=values)
