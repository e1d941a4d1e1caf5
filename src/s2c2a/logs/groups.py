"""Which motors belong to one module: those that go equally far, and whose cables stand all round."""

from collections.abc import Iterator, Sequence
from itertools import combinations, islice, product

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import largest_gap_deg
from s2c2a.logs.map import LogMap

MAX_GROUPINGS = 20_000
OPEN = 179.0  # deg between neighboring cables: such a module cannot bend every way
# what a gap of a whole turn more than even weighs, against a factor e in how far motors
# go
UNEVEN = 5.0
DEPENDENT = 1e-3  # least eigenvalue of correlations
FAR = 0.25  # a motor that is further off than this has not moved enough to be told

Grouping = tuple[tuple[int, ...], ...]


def likely_groups(
    effects: Float[np.ndarray, "drives ends 2"],
    columns: Float[np.ndarray, "rows drives"],
    told: LogMap,
    most: int,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """The likeliest modules and signs of all motors, best first.

    Args:
        effects: how far ends go across the arm for a unit of each column, innermost end
            first.
        columns: what they did.
        told: the map; what it states holds.
        most: how many.
    """
    reach = _reaches(effects)
    alike = np.nan_to_num(np.corrcoef(columns.T)).reshape(len(told.drives), -1)
    scored: list[
        tuple[float, int, tuple[Grouping, list[int], list[Sequence[int]]]]
    ] = []
    for grouping in islice(_groupings(told), MAX_GROUPINGS):
        ways = [_best_way(group, effects[:, -1], reach, told) for group in grouping]
        if all(way is not None for way in ways):
            cost = sum(way[0] for way in ways if way) + sum(
                not _dependent(alike, group) for group in grouping
            )
            signs = [way[1] for way in ways if way]
            scored.append(
                (cost, len(scored), (grouping, _outwards(grouping, reach, told), signs))
            )
    return [_as_arrays(*found, len(told.drives)) for *_, found in sorted(scored)[:most]]


def _dependent(alike: np.ndarray, group: Sequence[int]) -> bool:
    """Whether a column follows from the others: what a controller does to the three cables of a bend in a plane."""
    return len(group) > 2 and bool(
        np.linalg.eigvalsh(alike[np.ix_(group, group)])[0] < DEPENDENT
    )


def _reaches(effects: np.ndarray) -> np.ndarray:
    """How far out a motor's module is likely to be, as a logarithm: the smaller, the nearer to the base."""
    sizes = np.linalg.norm(effects, axis=-1) + 1e-12
    return (
        -np.log(sizes[:, -1])
        if sizes.shape[1] == 1
        else -(sizes[:, :-1] / sizes[:, -1:]).sum(axis=1)
    )


def _groupings(told: LogMap) -> Iterator[Grouping]:
    """Ways to part the motors into modules with as many cables each; stated ones stay together."""
    cables = [len(drive.cables) for drive in told.drives]
    each = sum(cables) / told.arm.modules

    def parted(left: tuple[int, ...]) -> Iterator[Grouping]:
        if not left:
            yield ()
            return
        first = left[0]
        others = left[1:]
        for count in range(len(others) + 1):
            for rest in combinations(others, count):
                group = (first, *rest)
                if sum(cables[drive] for drive in group) == each and _agree(
                    group, told
                ):
                    yield from (
                        (group, *more)
                        for more in parted(
                            tuple(one for one in others if one not in rest)
                        )
                    )

    return parted(tuple(range(len(cables))))


def _agree(group: Sequence[int], told: LogMap) -> bool:
    """Whether what is stated of their modules is one."""
    return len({told.drives[drive].module for drive in group} - {None}) <= 1


def _best_way(
    group: Sequence[int], tip: np.ndarray, reach: np.ndarray, told: LogMap
) -> tuple[float, Sequence[int]] | None:
    """How unlikely a module of these motors is, with its likeliest signs; None where it cannot bend every way."""
    ways = {"pulls": (1,), "releases": (-1,), "unknown": (1, -1)}
    tried = []
    for signs in product(*(ways[told.drives[drive].positive] for drive in group)):
        gap = largest_gap_deg(_angles(group, signs, tip, told))
        tried.append((gap, -sum(signs), signs))
    gap, _, signs = min(tried)
    if gap >= OPEN:
        return None
    even = 360.0 / sum(len(told.drives[drive].cables) for drive in group)
    apart = np.minimum((reach[list(group)] - np.median(reach[list(group)])) ** 2, FAR)
    return float(apart.mean() + UNEVEN * ((gap - even) / 360.0) ** 2), signs


def _angles(
    group: Sequence[int], signs: Sequence[int], tip: np.ndarray, told: LogMap
) -> list[float]:
    return [
        float(
            np.rad2deg(np.arctan2(sign * tip[drive, 1], sign * tip[drive, 0]))
            + cable.turn_deg
        )
        for drive, sign in zip(group, signs, strict=True)
        for cable in told.drives[drive].cables
    ]


def _outwards(grouping: Grouping, reach: np.ndarray, told: LogMap) -> list[int]:
    """The module of each group: as stated, the others from the base outwards."""
    stated = [
        next(
            (m for drive in group if (m := told.drives[drive].module) is not None), None
        )
        for group in grouping
    ]
    free = iter([module for module in range(told.arm.modules) if module not in stated])
    found = dict.fromkeys(range(len(grouping)), 0)
    for number in sorted(
        found, key=lambda number: reach[list(grouping[number])].mean()
    ):
        said = stated[number]
        found[number] = next(free) if said is None else said
    return list(found.values())


def _as_arrays(
    grouping: Grouping,
    ordered: Sequence[int],
    signs: Sequence[Sequence[int]],
    count: int,
):
    modules = np.zeros(count, int)
    ways = np.ones(count)
    for group, module, sign in zip(grouping, ordered, signs, strict=True):
        modules[list(group)] = module
        ways[list(group)] = sign
    return modules, ways
