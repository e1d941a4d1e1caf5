"""Which cable is where: first from straight lines through motions, then by fits that take turns."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import largest_gap_deg
from s2c2a.logs.errors import LogError
from s2c2a.logs.fitting import Fit, Seen, fitted
from s2c2a.logs.groups import likely_groups
from s2c2a.logs.map import Drive, LogMap
from s2c2a.logs.tendons import Guess, Wiring

STIFFNESS = 0.2  # of the arm over that of its cables, before anything is known
# ways of making modules that are fitted, for each idea of what the cables do
MAX_TRIED = 4
# a cost above so many times another one after the first rounds is not followed
HOPELESS = 1.3
UNEVEN_DEG = 60.0  # more than an even gap between cables: as unlikely as twice the cost
# the same, of signs: the model errs by more than the little that slack cables tell
SURE = 0.8
BETTER = 0.98  # a cost below this share of another one is better
# rounds of first and of further comparisons
FIRST = 5
TRIAL = 15


@dataclass(frozen=True)
class Motors:
    """What is assumed of the motors while numbers are fitted.

    Attributes:
        modules: that each one's cables end at, shape (drives,).
        signs: 1 where a larger number pulls, shape (drives,).
        coupled: whether cables run through inner modules and bend them.
    """

    modules: np.ndarray
    signs: np.ndarray
    coupled: bool


def wiring_of(motors: Motors, told: LogMap) -> Wiring:
    """The cables of all motors, in the map's order."""
    cables = [
        (drive, cable) for drive, one in enumerate(told.drives) for cable in one.cables
    ]
    owners = motors.modules[[drive for drive, _ in cables]]
    inside = (
        np.arange(told.arm.modules) <= owners[:, None]
        if motors.coupled
        else np.arange(told.arm.modules) == owners[:, None]
    )
    drives = np.array([drive for drive, _ in cables])
    turns = np.deg2rad([cable.turn_deg for _, cable in cables])
    return Wiring(
        inside.astype(float),
        drives,
        turns,
        motors.signs[drives] * np.array([cable.sign for _, cable in cables], float),
    )


def found_cables(
    seen: Seen, few: Seen, start: Guess, told: LogMap
) -> tuple[Fit, Motors, list[str]]:
    """Fit angles, gains, frame and lengths, and find what the map leaves open: modules, signs, coupling.

    Args:
        seen: rows of all sessions.
        few: those of them that are fitted.
        start: frame and lengths as registered; its angles and gains are replaced.
        told: the map.

    Returns:
        The fit, with standard deviations; what it assumes of the motors; what could not
        be told apart.

    Raises:
        LogError: no assignment gives every module cables that bend it every way.
    """
    trials = list(_trials(seen, few, start, told))
    if not trials:
        raise LogError(
            f"no {told.arm.modules} modules can be made of {len(told.drives)} drives: each needs as many cables, and "
            "no gap of 179 deg; say module and positive of each drive in the map"
        )
    best = sorted(trials, key=lambda trial: trial[0].cost)[:MAX_TRIED]
    further = [
        (fitted(few, fit.guess, fit.wiring, TRIAL), motors) for fit, motors in best
    ]
    fit, motors = min(further, key=lambda trial: trial[0].cost)
    fit, motors = _exchanged(few, fit, motors, told)
    fit, motors, doubts = _signed(few, fit, motors, told)
    return fitted(few, fit.guess, fit.wiring, errors=True), motors, doubts


def _trials(
    seen: Seen, few: Seen, start: Guess, told: LogMap
) -> Iterator[tuple[Fit, Motors]]:
    """Fits from several first ideas."""
    couplings = (
        [False, True] if told.arm.coupled_cables is None else [told.arm.coupled_cables]
    )
    tried = set()
    for effects in _effects_of(seen, told):
        for modules, signs in likely_groups(effects, seen.columns, told, MAX_TRIED):
            if (modules.tobytes(), signs.tobytes()) in tried:
                continue
            tried.add((modules.tobytes(), signs.tobytes()))
            for coupled in couplings:
                motors = Motors(modules, signs, coupled)
                guess = _first_numbers(effects, motors, start, told, seen)
                yield fitted(few, guess, wiring_of(motors, told), FIRST), motors


def _effects_of(seen: Seen, told: LogMap) -> Iterator[np.ndarray]:
    """Of pulls alone where it is known what pulls, since a slack cable does nothing; of all motion else."""
    ways = {
        "pulls": (0.0, np.inf),
        "releases": (-np.inf, 0.0),
        "unknown": (-np.inf, np.inf),
    }
    low, high = np.array(
        [
            ways[drive.positive if len(drive.cables) == 1 else "unknown"]
            for drive in told.drives
        ]
    ).T
    for columns in (np.clip(seen.columns, low, high), seen.columns):
        yield _effects(replace(seen, columns=columns), differences=False)
        if columns is not seen.columns and not (np.isinf(low) & np.isinf(high)).any():
            yield _effects(replace(seen, columns=columns), differences=True)


def _effects(seen: Seen, differences: bool) -> Float[np.ndarray, "drives ends 2"]:
    """How far ends go across the arm for a unit of each column; of steps, or of whole ways."""
    ends = np.flatnonzero(np.isfinite(seen.states[..., 0]).any(axis=0))
    across = seen.states[:, ends, :3] @ seen.frame[:, :2]
    columns = seen.columns
    ways = across.reshape(len(across), -1)
    if differences:
        columns = np.diff(columns, axis=0)
        ways = np.diff(ways, axis=0)
    else:
        columns = columns - columns.mean(axis=0)
        ways = ways - np.nanmean(ways, axis=0)
    known = np.isfinite(ways).all(axis=1)
    return _line_through(columns[known], ways[known]).reshape(
        columns.shape[1], len(ends), 2
    )


def _line_through(
    columns: np.ndarray, ways: np.ndarray, rounds: int = 30
) -> np.ndarray:
    """Slopes by least squares in which what is far off weighs less, and directions that hardly move count as none."""
    weights = np.ones(len(columns))
    slopes = np.zeros((columns.shape[1], ways.shape[1]))
    size = columns.std(axis=0) + 1e-12
    for _ in range(rounds):
        half = np.sqrt(weights)[:, None]
        slopes = (
            np.linalg.lstsq(half * columns / size, half * ways, rcond=0.03)[0]
            / size[:, None]
        )
        off = np.linalg.norm(ways - columns @ slopes, axis=1)
        usual = np.median(off) + 1e-9
        weights = 1.0 / np.maximum(1.0, off / usual)
    return slopes


def _first_numbers(
    effects: np.ndarray, motors: Motors, start: Guess, told: LogMap, seen: Seen
) -> Guess:
    """Angles from where the tip goes, gains from how far."""
    ends = np.flatnonzero(np.isfinite(seen.states[..., 0]).any(axis=0))
    tip = effects[:, -1]
    lengths = np.exp(start.lengths)
    levers = np.array(
        [_lever(lengths, module, ends[-1], motors.coupled) for module in motors.modules]
    )
    ways = motors.signs[:, None] * tip
    stated = np.array(
        [
            np.nan if drive.angle_deg is None else np.deg2rad(drive.angle_deg)
            for drive in told.drives
        ]
    )
    angles = np.where(np.isnan(stated), np.arctan2(ways[:, 1], ways[:, 0]), stated)
    gains = np.linalg.norm(tip, axis=1) / levers
    usual = np.median(gains[gains > 0]) if (gains > 0).any() else 1.0
    return start._replace(angles=angles, gain=np.log(usual))


def _lever(lengths: np.ndarray, module: int, end: int, coupled: bool) -> float:
    """How far an end goes across the arm for a radian that a cable of a module asks for."""
    module = min(module, end)
    after = [
        lengths[one] / 2 + lengths[one + 1 : end + 1].sum() for one in range(end + 1)
    ]
    return float(np.mean(after[: module + 1]) if coupled else after[module])


def _exchanged(
    seen: Seen, fit: Fit, motors: Motors, told: LogMap
) -> tuple[Fit, Motors]:
    """Exchange the modules of two motors, or all of two modules, while that explains more."""
    tried = True
    while tried:
        tried = False
        for modules in list(_exchanges(fit, motors, told)):
            trial = replace(motors, modules=modules)
            again = fitted(seen, fit.guess, wiring_of(trial, told), FIRST)
            if again.cost < HOPELESS * fit.cost:
                again = fitted(seen, again.guess, again.wiring, TRIAL)
            if again.cost < BETTER * fit.cost and _can_be_built(again, trial, told):
                fit = again
                motors = trial
                tried = True
                break
    return fit, motors


def _exchanges(fit: Fit, motors: Motors, told: LogMap) -> Iterator[np.ndarray]:
    """Neighboring modules exchanged, then motors of neighboring modules that pull alike; what is stated stays."""
    modules = motors.modules
    angles = fit.guess.angles
    stays = np.array([drive.module is not None for drive in told.drives])
    for inner in range(told.arm.modules - 1):
        exchanged = np.where(
            modules == inner, inner + 1, np.where(modules == inner + 1, inner, modules)
        )
        if not stays[modules != exchanged].any():
            yield exchanged
    for one, other in permutations(np.flatnonzero(~stays), 2):
        alike = len(told.drives[one].cables) == len(told.drives[other].cables)
        near = (
            len(told.drives[one].cables) > 1
            or np.cos(angles[one] - angles[other]) > 0.3
        )
        if modules[other] == modules[one] + 1 and alike and near:
            exchanged = modules.copy()
            exchanged[[one, other]] = modules[[other, one]]
            yield exchanged


def thinned(seen: Seen, most: int) -> Seen:
    """Rows evenly spread over all."""
    rows = np.linspace(0, len(seen.columns) - 1, min(len(seen.columns), most)).astype(
        int
    )
    return replace(seen, columns=seen.columns[rows], states=seen.states[rows])


def _can_be_built(fit: Fit, motors: Motors, told: LogMap) -> bool:
    return all(
        len(angles) and largest_gap_deg(angles) < 179
        for angles in angles_deg(fit, motors, told)
    )


def angles_deg(fit: Fit, motors: Motors, told: LogMap) -> list[np.ndarray]:
    """Where the cables of each module are [deg], in the map's order."""
    wiring = fit.wiring
    angles = np.rad2deg(fit.guess.angles[wiring.drive] + wiring.turn)
    return [
        angles[motors.modules[wiring.drive] == module]
        for module in range(told.arm.modules)
    ]


def _even(drive: Drive) -> bool:
    """Whether a motor turned round is the same motor at the opposite angle, as with a pair of cables."""
    cables = {(round(cable.turn_deg) % 360, cable.sign) for cable in drive.cables}
    return cables == {((turn + 180) % 360, -sign) for turn, sign in cables}


def _signed(
    seen: Seen, fit: Fit, motors: Motors, told: LogMap
) -> tuple[Fit, Motors, list[str]]:
    """Turn unknown signs of a module round, with its angles, where that explains more; say where it says nothing."""
    doubts = []
    for module in range(told.arm.modules):
        here = motors.modules == module
        drives = [told.drives[drive] for drive in np.flatnonzero(here)]
        if any(drive.positive != "unknown" for drive in drives) or all(
            map(_even, drives)
        ):
            continue
        trial = replace(motors, signs=np.where(here, -motors.signs, motors.signs))
        turned = fit.guess._replace(angles=fit.guess.angles + np.pi * here)
        again = fitted(seen, turned, wiring_of(trial, told), TRIAL)
        ratio = _unlikely(again, trial, module) / _unlikely(fit, motors, module)
        if SURE < ratio < 1 / SURE:
            doubts.append(
                f"module {module}: whether larger numbers pull or let go (the other way explains about as much)"
            )
        if ratio < 1:
            fit = again
            motors = trial
    return fit, motors, doubts


def _unlikely(fit: Fit, motors: Motors, module: int) -> float:
    """A fit's cost, more where the cables of a module stand unevenly: of wrong signs, slack cables make them do so."""
    wiring = fit.wiring
    angles = np.rad2deg(fit.guess.angles[wiring.drive] + wiring.turn)[
        motors.modules[wiring.drive] == module
    ]
    return fit.cost * (
        1 + ((largest_gap_deg(angles) - 360 / len(angles)) / UNEVEN_DEG) ** 2
    )
