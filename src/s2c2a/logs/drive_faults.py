"""Single drives whose sign, place or unit in a map is wrong, from the ends' motion.

Linear regression of the ends on all drives gives the effect of each: a direction across
the arm, and a size per unit of the column. Directions of a module's cables surround the
arm only with the right signs, and a unit changes a size by a factor beyond all levers.
"""

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from s2c2a.logs.assignment import rank_assignments
from s2c2a.logs.cable_search import regress_ends
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.map_changes import PLACE, Change, angles_of, exchange_drives, signs_of
from s2c2a.logs.model_fit import Observations
from s2c2a.logs.priors import without_turn

MAX_CHANGES = 3  # that are fitted, of those that agree best with the effects
# between the effects of a drive and of any other; those of neighboring modules of four
# arms differ by 2.5, those of the mates of a still drive by 6, and most units by more
FOREIGN = 8.0
# share of the median drive's motion of the ends; noise of still drives moves them less
MOVES_ENDS = 0.1


def likely_changes(
    observations: Observations,
    log_map: LogMap,
) -> list[Change]:
    """Changes of the signs or places of drives that the effects contradict less.

    Args:
        observations: rows of all takes.
        log_map: the map, whose unstated values change nothing.

    Returns:
        Clauses and changed maps, the most likely one first.
    """
    effects = regress_ends(observations, differences=False)
    columns = observations.columns
    stated = _contradiction(effects, columns, log_map)
    changes = []
    costs = []
    for change in _changes(log_map):
        cost = _contradiction(effects, columns, change[1])
        if cost < stated:
            changes.append(change)
            costs.append(cost)
    order = np.argsort(costs, kind="stable")
    return [changes[place] for place in order[:MAX_CHANGES]]


def _contradiction(effects: np.ndarray, columns: np.ndarray, log_map: LogMap) -> float:
    """Cost of the best assignment, and the errors of stated angles."""
    signs = signs_of(log_map)
    x, y = signs * effects[:, -1].T
    angles = np.arctan2(y, x)
    stated = angles_of(log_map)
    errors = without_turn(angles - stated, log_map)
    turned = float(np.nansum(1 - np.cos(errors)))
    for _, _, uneven in rank_assignments(effects, columns, log_map, 1):
        return turned + uneven
    return np.inf


def _changes(log_map: LogMap) -> Iterator[Change]:
    """Maps with one drive reversed, or with two exchanged."""
    other = {"pulls": "releases", "releases": "pulls"}
    for index, drive in enumerate(log_map.drives):
        if drive.pushes or drive.positive not in other:
            continue
        positive = other[drive.positive]
        drives = list(log_map.drives)
        drives[index] = drive.model_copy(update={"positive": positive})
        changed = log_map.model_copy(update={"drives": tuple(drives)})
        yield f"reverse `positive` of '{drive.name}'", changed
    for pair in combinations(range(len(log_map.drives)), 2):
        clause, changed = exchange_drives(pair, PLACE, log_map)
        if changed != log_map:
            yield clause, changed


def excess_travel(
    observations: Observations,
    log_map: LogMap,
) -> str:
    """Sentence on a drive that moves by more cable than the arm is long; may be empty."""
    length = observations.scale
    columns = observations.columns
    low = np.nanmin(columns, axis=0)
    high = np.nanmax(columns, axis=0)
    travel = high - low
    for drive, distance in zip(log_map.drives, travel, strict=True):
        is_stated = drive.unit != "free" and not log_map.by_force
        if is_stated and distance > length:
            return (
                f"'{drive.name}' moves by {distance:.3g} m, and the arm is "
                f"{length:.3g} m long; correct its unit in the map"
            )
    return ""


def foreign_units(
    observations: Observations,
    log_map: LogMap,
) -> tuple[str, list[np.ndarray]]:
    """Clause on a drive whose unit is not that of the others; empty if there is none.

    Of two drives it names both.

    Returns:
        The clause, and factors of all drives. Those of one entry make the log
        explicable if the clause is true.
    """
    effects = regress_ends(observations, differences=False)
    sizes = np.linalg.norm(effects[:, -1], axis=1)
    motions = sizes * observations.columns.std(axis=0)
    least = MOVES_ENDS * np.median(motions)
    moving = np.flatnonzero(motions > least)
    relative = _without_levers(np.log(sizes[moving]), moving, log_map)
    order = np.argsort(relative)
    gaps = np.diff(relative[order])
    if gaps.max(initial=0.0) < np.log(FOREIGN):
        return "", []
    cut = int(np.argmax(gaps)) + 1
    sides = sorted((order[:cut], order[cut:]), key=len)
    few, others = (moving[side] for side in sides)
    if len(few) > 1:  # rather modules than several wrong drives
        return "", []
    own, usual = (relative[side].mean() for side in sides)
    ratio = float(np.exp(own - usual))
    factors = np.ones((2, len(sizes)))
    factors[0, few] = ratio
    factors[1, others] = 1.0 / ratio
    if len(few) < len(others):
        return (
            f"the unit or scale of {_names(few, log_map)} is wrong: per unit of the map, "
            f"the ends follow about {float(f'{ratio:.1g}'):g} times as far as with other "
            "drives"
        ), [factors[0]]
    clause = (
        f"the units or scales of {_names(moving, log_map)} differ; the log does not "
    )
    return f"{clause}tell which is wrong", list(factors)


def _names(indices: np.ndarray, log_map: LogMap) -> str:
    """Names of drives, in the order of the map."""
    names = [log_map.drives[index].name for index in sorted(indices)]
    return ", ".join(f"'{name}'" for name in names)


def _without_levers(
    sizes: np.ndarray,
    drives: np.ndarray,
    log_map: LogMap,
) -> np.ndarray:
    """Logarithmic sizes relative to those of the same module, if modules are stated.

    Of two drives in a module, none is like the most.
    """
    modules = [log_map.drives[index].module for index in drives]
    relative = sizes.copy()
    for module in set(modules):
        own = np.array([each == module for each in modules])
        if module is None or own.sum() < 3:
            return sizes
        relative[own] -= np.median(sizes[own])
    return relative
