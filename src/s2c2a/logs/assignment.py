"""Assignment of motors to modules, from the tip motions that they cause.

Motors of one module move the tip equally far, and their cables surround the arm.
"""

from collections.abc import Collection, Iterator, Sequence
from itertools import combinations, islice, product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import MAX_GAP_DEG, largest_gap_deg
from s2c2a.logs.log_map import LogMap

MAX_GROUPINGS = 20_000
MAX_OPPOSED_DEG = 225.0  # gap between two opposed cables, identified with an error
# cost of uneven cables: a gap of one turn more than even, relative to a factor of e
# between the tip motions of motors
UNEVEN_COST = 5.0
MIN_EIGENVALUE = 1e-3  # of the correlations of independent columns
# largest cost of a difference in reach: such a motor has hardly moved
MAX_REACH_COST = 0.25

Group = tuple[int, ...]
Grouping = tuple[Group, ...]


def can_bend(angles_deg: Collection[float]) -> bool:
    """Whether cables that only pull bend a module: two in a plane, more everywhere."""
    largest = MAX_OPPOSED_DEG if len(angles_deg) == 2 else MAX_GAP_DEG
    return len(angles_deg) > 0 and largest_gap_deg(angles_deg) < largest


class _Candidate(NamedTuple):
    """Assignment and its cost; `rank` keeps candidates of equal cost in order."""

    cost: float
    rank: int
    grouping: Grouping
    signs: list[tuple[int, ...]]


def rank_assignments(
    effects: Float[np.ndarray, "drives ends 2"],
    columns: Float[np.ndarray, "rows drives"],
    log_map: LogMap,
    count: int,
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Most likely modules and signs of all motors, best first.

    Args:
        effects: displacement of the ends across the arm per unit of each column,
            innermost end first.
        columns: values of the drives.
        log_map: the map; what it states holds.
        count: number of assignments.

    Returns:
        Modules and signs, each of shape (drives,), with their cost.
    """
    reach = _log_reach(effects)
    tip = effects[:, -1]
    with np.errstate(invalid="ignore"):  # constant columns
        correlations = np.nan_to_num(np.corrcoef(columns.T))
    correlations = correlations.reshape(len(log_map.drives), -1)
    candidates: list[_Candidate] = []
    for grouping in islice(_groupings(log_map), MAX_GROUPINGS):
        cost = 0.0
        independent = 0
        signs = []
        for group in grouping:
            best = _best_signs(group, tip, reach, log_map)
            if best is None:
                break
            cost += best[0]
            independent += not _is_dependent(correlations, group)
            signs.append(best[1])
        else:
            cost += independent
            candidates.append(_Candidate(cost, len(candidates), grouping, signs))
    candidates.sort()
    return [_to_arrays(best, reach, log_map) for best in candidates[:count]]


def _is_dependent(correlations: np.ndarray, group: Group) -> bool:
    """Whether one column follows from the others.

    This holds for the three cables of a module whose controller commands a bend.
    """
    if len(group) < 3:
        return False
    eigenvalues = np.linalg.eigvalsh(correlations[np.ix_(group, group)])
    return bool(eigenvalues[0] < MIN_EIGENVALUE)


def _log_reach(effects: np.ndarray) -> np.ndarray:
    """Distance of a motor's module from the base, on a logarithmic scale."""
    sizes = np.linalg.norm(effects, axis=-1) + 1e-12
    if sizes.shape[1] == 1:
        return -np.log(sizes[:, -1])
    shares = sizes[:, :-1] / sizes[:, -1:]
    return -shares.sum(axis=1)


def _groupings(log_map: LogMap) -> Iterator[Grouping]:
    """Groups of motors: the stated ones, or such with equal numbers of cables."""
    if all(drive.module is not None for drive in log_map.drives):
        return iter([_stated_grouping(log_map)])
    cables = [len(drive.cables) for drive in log_map.drives]
    cables_per_module = sum(cables) / log_map.arm.modules

    def split(remaining: Group) -> Iterator[Grouping]:
        if not remaining:
            yield ()
            return
        first, *others = remaining
        for size in range(len(others) + 1):
            for rest in combinations(others, size):
                group = (first, *rest)
                if sum(cables[drive] for drive in group) != cables_per_module:
                    continue
                if len(_stated_modules(group, log_map)) > 1:
                    continue
                unused = tuple(drive for drive in others if drive not in rest)
                for groups in split(unused):
                    yield (group, *groups)

    return split(tuple(range(len(cables))))


def _stated_grouping(log_map: LogMap) -> Grouping:
    groups: dict[int | None, Group] = {}
    for index, drive in enumerate(log_map.drives):
        groups[drive.module] = (*groups.get(drive.module, ()), index)
    return tuple(groups.values())


def _stated_modules(group: Group, log_map: LogMap) -> set[int]:
    modules = {log_map.drives[drive].module for drive in group}
    return {module for module in modules if module is not None}


def _best_signs(
    group: Group, tip: np.ndarray, reach: np.ndarray, log_map: LogMap
) -> tuple[float, tuple[int, ...]] | None:
    """Cost and most likely signs of a group; None if its cables cannot bend a module."""
    stated = [log_map.drives[drive].sign for drive in group]
    choices = [(sign,) if sign else (1, -1) for sign in stated]
    trials = []
    for signs in product(*choices):
        angles = _cable_angles_deg(group, signs, tip, log_map)
        trials.append((largest_gap_deg(angles), -sum(signs), signs, can_bend(angles)))
    gap, _, signs, bends = min(trials)
    if not bends:
        return None
    cable_count = sum(len(log_map.drives[drive].cables) for drive in group)
    reaches = reach[list(group)]
    reach_cost = np.minimum((reaches - np.median(reaches)) ** 2, MAX_REACH_COST)
    gap_cost = UNEVEN_COST * ((gap - 360.0 / cable_count) / 360.0) ** 2
    return float(reach_cost.mean() + gap_cost), signs


def _cable_angles_deg(
    group: Group, signs: Sequence[int], tip: np.ndarray, log_map: LogMap
) -> list[float]:
    angles = []
    for drive, sign in zip(group, signs, strict=True):
        x, y = sign * tip[drive]
        angle = float(np.rad2deg(np.arctan2(y, x)))
        angles += [angle + cable.turn_deg for cable in log_map.drives[drive].cables]
    return angles


def _order_modules(
    grouping: Grouping, reach: np.ndarray, log_map: LogMap
) -> dict[Group, int]:
    """Module of each group: as stated, the others from the base outward."""
    modules = {}
    free = []
    for group in grouping:
        stated = _stated_modules(group, log_map)
        if stated:
            modules[group] = stated.pop()
        else:
            free.append(group)
    used = set(modules.values())
    unused = [module for module in range(log_map.arm.modules) if module not in used]
    free.sort(key=lambda group: reach[list(group)].mean())
    return modules | dict(zip(free, unused, strict=False))


def _to_arrays(
    candidate: _Candidate, reach: np.ndarray, log_map: LogMap
) -> tuple[np.ndarray, np.ndarray, float]:
    """Module and sign of each motor, and the cost."""
    modules = np.zeros(len(reach), int)
    signs = np.ones(len(reach))
    order = _order_modules(candidate.grouping, reach, log_map)
    for group, sign in zip(candidate.grouping, candidate.signs, strict=True):
        modules[list(group)] = order[group]
        signs[list(group)] = sign
    return modules, signs, candidate.cost
