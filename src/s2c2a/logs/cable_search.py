"""Search for modules, signs, and coupling of the cables.

Linear regression of the motions gives first candidates; fits of the cable model compare
them.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import MAX_GAP_DEG, largest_gap_deg
from s2c2a.errors import counted
from s2c2a.execution.progress import Progress, quiet
from s2c2a.logs.assignment import can_bend, rank_assignments
from s2c2a.logs.cable_model import CableParameters, Wiring
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import Drive, LogMap
from s2c2a.logs.model_fit import CableFit, Observations, fit_parameters
from s2c2a.logs.priors import stated_angles, with_stated_angles

MAX_CANDIDATES = 4  # assignments that are fitted, for each estimate of the effects
PARTS = MAX_CANDIDATES + 3  # of a search: trials, fits, exchanges, the last fit
FITTING = "fitting modules, signs and angles of the cables"
# a trial with more than this ratio of costs after the first iterations is dropped
DROP_RATIO = 1.3
UNEVEN_DEG = 60.0  # a gap this much above an even one doubles the cost
# signs are ambiguous above this ratio of costs: the model error exceeds the little that
# slack cables show
AMBIGUOUS_RATIO = 0.8
IMPROVED_RATIO = 0.98  # a cost below this ratio is an improvement
FIRST_ITERATIONS = 5
TRIAL_ITERATIONS = 15
REWEIGHTINGS = 30  # of a regression


@dataclass(frozen=True)
class Assignment:
    """Modules and signs of the motors.

    Attributes:
        modules: module at which each motor's cables end, shape (drives,).
        signs: 1 where a larger number pulls, shape (drives,).
        coupled: whether cables run through inner modules and bend them.
    """

    modules: np.ndarray
    signs: np.ndarray
    coupled: bool


CableTrial = tuple[CableFit, Assignment]


def build_wiring(assignment: Assignment, log_map: LogMap) -> Wiring:
    """Wiring of all cables, in the order of the map."""
    drives = []
    turns = []
    signs = []
    for index, drive in enumerate(log_map.drives):
        for cable in drive.cables:
            drives.append(index)
            turns.append(np.deg2rad(cable.turn_deg))
            signs.append(assignment.signs[index] * cable.sign)
    modules = np.arange(log_map.arm.modules)
    owners = assignment.modules[drives][:, None]
    reach = modules <= owners if assignment.coupled else modules == owners
    return Wiring(
        reach.astype(float), np.array(drives), np.array(turns), np.array(signs, float)
    )


def identify_cables(
    observations: Observations,
    start: CableParameters,
    log_map: LogMap,
    progress: Progress = quiet,
) -> tuple[CableFit, Assignment, list[str]]:
    """Fit the cable model, and find the modules, signs, and coupling not in the map.

    Args:
        observations: rows of all takes.
        start: registered frame and lengths; its angles and gains are not used.
        log_map: the map.
        progress: called before each part of the search.

    Returns:
        The fit with standard deviations, its assignment, and what is ambiguous.

    Raises:
        LogError: no assignment gives every module cables that bend it in all
            directions.
    """
    subset = observations.thinned()
    progress(FITTING, 0, PARTS)
    trials = list(_first_trials(observations, subset, start, log_map))
    if not trials:
        raise LogError(
            f"{counted(len(log_map.drives), 'drive')} cannot form "
            f"{counted(log_map.arm.modules, 'module')}: each needs the same number of "
            f"cables, two opposed ones or more without a gap of {MAX_GAP_DEG:.0f} deg; "
            "state module and positive of each drive in the map (numbers of cables may "
            "then differ)"
        )
    trials.sort(key=lambda trial: trial[0].cost)
    fits = []
    for number, (fit, _) in enumerate(trials[:MAX_CANDIDATES], 1):
        progress(FITTING, number, PARTS)
        fits.append(_refit(subset, fit))
    best = int(np.argmin([fit.cost for fit in fits]))
    progress(FITTING, PARTS - 2, PARTS)
    fit, assignment = _exchange_motors(subset, fits[best], trials[best][1], log_map)
    fit, assignment, ambiguities = _choose_signs(subset, fit, assignment, log_map)
    progress(FITTING, PARTS - 1, PARTS)
    fit = fit_parameters(subset, fit.parameters, fit.wiring, with_std=True)
    progress(FITTING, PARTS, PARTS)
    return fit, assignment, ambiguities


def _refit(observations: Observations, fit: CableFit) -> CableFit:
    return fit_parameters(observations, fit.parameters, fit.wiring, TRIAL_ITERATIONS)


def _first_trials(
    observations: Observations,
    subset: Observations,
    start: CableParameters,
    log_map: LogMap,
) -> Iterator[CableTrial]:
    """Short fits of the most likely assignments."""
    couplings = [False, True]
    if log_map.arm.coupled_cables is not None:
        couplings = [log_map.arm.coupled_cables]
    tried = set()
    columns = observations.columns
    for assumed, effects in _estimate_effects(observations, log_map):
        ranked = rank_assignments(effects, columns, assumed, MAX_CANDIDATES)
        for modules, signs, _ in ranked:
            key = (modules.tobytes(), signs.tobytes())
            if key in tried:
                continue
            tried.add(key)
            for coupled in couplings:
                assignment = Assignment(modules, signs, coupled)
                # angles from the direction of the tip's motion, the gain from its size
                ends = _measured_ends(observations)
                tip = effects[:, -1]
                lengths = np.exp(start.lengths)
                levers = [
                    _lever(lengths, module, ends[-1], assignment.coupled)
                    for module in assignment.modules
                ]
                pulls = assignment.signs[:, None] * tip
                angles = np.arctan2(pulls[:, 1], pulls[:, 0])
                angles = with_stated_angles(angles, stated_angles(log_map), log_map)
                gains = np.linalg.norm(tip, axis=1) / np.array(levers)
                gains = gains[gains > 0]
                gain = np.log(np.median(gains) if len(gains) else 1.0)
                if (
                    log_map.by_force
                ):  # bends follow from pulls by the arm's stiffness alone
                    gain = gain + start.stiffness
                first = start._replace(angles=angles, gain=gain)
                wiring = build_wiring(assignment, log_map)
                fit = fit_parameters(subset, first, wiring, FIRST_ITERATIONS)
                yield fit, assignment


def _measured_ends(observations: Observations) -> np.ndarray:
    """Modules whose ends are measured."""
    return np.flatnonzero(np.isfinite(observations.states[..., 0]).any(axis=0))


def _estimate_effects(
    observations: Observations, log_map: LogMap
) -> Iterator[tuple[LogMap, Float[np.ndarray, "drives ends 2"]]]:
    """Maps with assumed signs, and effects of pulling alone and of all motion.

    Slack cables have no effect, so drives of unknown signs are assumed to pull, and
    to release; all motion leaves their signs open.
    """
    # range of column values for which the effect on the cable is clear
    goes_slack = [len(each.cables) == 1 and not each.pushes for each in log_map.drives]
    for assumed in _assumed_maps(log_map, goes_slack):
        signs = np.array([drive.sign for drive in assumed.drives]) * goes_slack
        low = np.where(signs > 0, 0.0, -np.inf)
        high = np.where(signs < 0, 0.0, np.inf)
        pulling = replace(
            observations, columns=np.clip(observations.columns, low, high)
        )
        yield assumed, regress_ends(pulling, differences=False)
        if (np.isfinite(low) | np.isfinite(high)).all():
            yield assumed, regress_ends(pulling, differences=True)
    yield log_map, regress_ends(observations, differences=False)


def _assumed_maps(log_map: LogMap, goes_slack: list[bool]) -> list[LogMap]:
    maps = []
    for effect in ("pulls", "releases"):
        drives = tuple(
            drive.model_copy(update={"positive": effect})
            if slack and drive.effect == "unknown"
            else drive
            for drive, slack in zip(log_map.drives, goes_slack, strict=True)
        )
        maps.append(log_map.model_copy(update={"drives": drives}))
    return maps[:1] if maps[0] == maps[1] else maps


def regress_ends(
    observations: Observations, differences: bool
) -> Float[np.ndarray, "drives ends 2"]:
    """Displacement of the ends across the arm per unit of each column.

    Args:
        observations: the rows.
        differences: whether to regress steps between rows, not displacements.
    """
    columns = observations.columns
    ends = _measured_ends(observations)
    positions = observations.states[:, ends, :3]
    across = positions @ observations.axes[:, :2]
    displacements = across.reshape(len(across), -1)
    if differences:
        columns = np.diff(columns, axis=0)
        displacements = np.diff(displacements, axis=0)
    else:
        columns = columns - columns.mean(axis=0)
        displacements = displacements - np.nanmean(displacements, axis=0)
    known = np.isfinite(displacements).all(axis=1)
    slopes = _robust_slopes(columns[known], displacements[known])
    return slopes.reshape(columns.shape[1], len(ends), 2)


def _robust_slopes(columns: np.ndarray, displacements: np.ndarray) -> np.ndarray:
    """Iteratively reweighted least squares; directions with little motion are zero."""
    weights = np.ones(len(columns))
    slopes = np.zeros((columns.shape[1], displacements.shape[1]))
    size = columns.std(axis=0) + 1e-12
    for _ in range(REWEIGHTINGS):
        root = np.sqrt(weights)[:, None]
        solution = np.linalg.lstsq(
            root * columns / size, root * displacements, rcond=0.03
        )
        slopes = solution[0] / size[:, None]
        errors = np.linalg.norm(displacements - columns @ slopes, axis=1)
        weights = 1.0 / np.maximum(1.0, errors / (np.median(errors) + 1e-9))
    return slopes


def _lever(lengths: np.ndarray, module: int, end: int, coupled: bool) -> float:
    """Displacement of an end across the arm per radian of a cable's pull [m]."""
    module = min(module, end)
    levers = [
        lengths[inner] / 2 + lengths[inner + 1 : end + 1].sum()
        for inner in range(end + 1)
    ]
    return float(np.mean(levers[: module + 1]) if coupled else levers[module])


def _exchange_motors(
    observations: Observations, fit: CableFit, assignment: Assignment, log_map: LogMap
) -> CableTrial:
    """Exchange two motors, or all motors of two modules, while the cost falls."""
    improved = True
    while improved:
        improved = False
        for modules in list(_exchanges(fit, assignment, log_map)):
            trial = replace(assignment, modules=modules)
            wiring = build_wiring(trial, log_map)
            new = fit_parameters(observations, fit.parameters, wiring, FIRST_ITERATIONS)
            if new.cost < DROP_RATIO * fit.cost:
                new = _refit(observations, new)
            is_feasible = all(
                can_bend(_cable_angles_deg(new, trial, module))
                for module in range(log_map.arm.modules)
            )
            if new.cost < IMPROVED_RATIO * fit.cost and is_feasible:
                fit = new
                assignment = trial
                improved = True
                break
    return fit, assignment


def _exchanges(
    fit: CableFit, assignment: Assignment, log_map: LogMap
) -> Iterator[np.ndarray]:
    """Modules after each possible exchange; motors with a stated module stay.

    Neighboring modules come first, then pairs of motors of neighboring modules that
    pull in similar directions.
    """
    modules = assignment.modules
    angles = fit.parameters.angles
    drives = log_map.drives
    fixed = np.array([drive.module is not None for drive in drives])
    for inner in range(log_map.arm.modules - 1):
        exchanged = modules.copy()
        exchanged[modules == inner] = inner + 1
        exchanged[modules == inner + 1] = inner
        if not fixed[modules != exchanged].any():
            yield exchanged
    for first, second in permutations(np.flatnonzero(~fixed), 2):
        cables = len(drives[first].cables)
        if modules[second] != modules[first] + 1:
            continue
        if len(drives[second].cables) != cables:
            continue
        if cables > 1 or np.cos(angles[first] - angles[second]) > 0.3:
            exchanged = modules.copy()
            exchanged[[first, second]] = modules[[second, first]]
            yield exchanged


def _cable_angles_deg(
    fit: CableFit,
    assignment: Assignment,
    module: int,
) -> np.ndarray:
    """Angles of a module's cables [deg], in the order of the map."""
    wiring = fit.wiring
    angles = np.rad2deg(fit.parameters.angles[wiring.drive] + wiring.turn)
    return angles[assignment.modules[wiring.drive] == module]


def is_symmetric(drive: Drive) -> bool:
    """Whether reversing a motor equals turning it by 180 deg, as for a cable pair."""
    cables = {(round(cable.turn_deg) % 360, cable.sign) for cable in drive.cables}
    return cables == {((turn + 180) % 360, -sign) for turn, sign in cables}


def _choose_signs(
    observations: Observations, fit: CableFit, assignment: Assignment, log_map: LogMap
) -> tuple[CableFit, Assignment, list[str]]:
    """Reverse the motors of modules with unknown signs where that lowers the cost."""
    ambiguities = []
    for module in range(log_map.arm.modules):
        members = assignment.modules == module
        drives = [log_map.drives[index] for index in np.flatnonzero(members)]
        if any(drive.effect != "unknown" for drive in drives):
            continue
        if all(is_symmetric(drive) for drive in drives):
            continue
        signs = np.where(members, -assignment.signs, assignment.signs)
        trial = replace(assignment, signs=signs)
        # as far on its way as the trial
        fit = _refit(observations, fit)
        angles = fit.parameters.angles + np.pi * members
        new = fit_parameters(
            observations,
            fit.parameters._replace(angles=angles),
            build_wiring(trial, log_map),
            TRIAL_ITERATIONS,
        )
        ratio = _sign_cost(new, trial, module) / _sign_cost(fit, assignment, module)
        # uneven cables decide, but are no proof: right signs of a poor model have some
        ratios = (ratio, new.cost / fit.cost)
        if max(ratios) > AMBIGUOUS_RATIO and min(ratios) < 1 / AMBIGUOUS_RATIO:
            is_close = AMBIGUOUS_RATIO < ratios[1] < 1 / AMBIGUOUS_RATIO
            doubt = "both explain the log about equally well"
            if not is_close:
                doubt = "the better fit has the less even cables"
            ambiguities.append(
                f"signs of module {module + 1}: larger numbers pull or release "
                f"({doubt}; state `positive` of its drives)"
            )
        if ratio < 1:
            fit = new
            assignment = trial
    return fit, assignment, ambiguities


def _sign_cost(fit: CableFit, assignment: Assignment, module: int) -> float:
    """Cost of a fit, increased for uneven cables, which wrong signs cause."""
    angles = _cable_angles_deg(fit, assignment, module)
    excess = largest_gap_deg(angles) - 360 / len(angles)
    return fit.cost * (1 + (excess / UNEVEN_DEG) ** 2)
