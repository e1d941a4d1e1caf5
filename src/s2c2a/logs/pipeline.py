"""Import of logs: from files and a map to episodes and an arm file."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmSpec, arm_from_toml, arm_to_toml
from s2c2a.data import Recording
from s2c2a.episodes import Episode, save_episodes
from s2c2a.errors import ArmError, S2C2AError, counted
from s2c2a.execution.progress import Progress, quiet
from s2c2a.files.text import write_atomically
from s2c2a.logs.arm_file import CableLayout, build_layout, format_arm, match_layout
from s2c2a.logs.cable_model import CableParameters, tilt_rotation
from s2c2a.logs.cable_search import AMBIGUOUS_RATIO, Assignment, identify_cables
from s2c2a.logs.cleaning import Excluded, exclude_outliers
from s2c2a.logs.clocks import LogClock
from s2c2a.logs.drive_faults import excess_travel, foreign_units, likely_changes
from s2c2a.logs.errors import LogError
from s2c2a.logs.frame_motion import FrameMotion, find_frame_motions
from s2c2a.logs.log_map import LogMap
from s2c2a.logs.map_changes import (
    OTHER_LENGTHS,
    Change,
    Identified,
    contradicts_angles,
    describe_angles,
    find_changes,
    other_commands,
    other_directions,
    other_length,
    reversed_drives,
    reversed_modules,
    settled_rows,
    unstated_angles,
    unstated_lengths,
    unstated_sizes,
    with_assignment,
)
from s2c2a.logs.map_diagnosis import (
    CLEARLY,
    MOST,
    POOR,
    FreeFit,
    fit_freely,
    free_scale,
    missed_share,
    unit_change,
)
from s2c2a.logs.model_fit import CableFit, Observations, predict_states
from s2c2a.logs.poor_fits import describe_poor_fit
from s2c2a.logs.priors import first_guess, prior_std, stated_bounds
from s2c2a.logs.reading import read_table
from s2c2a.logs.registration import estimate_registration, estimate_z
from s2c2a.logs.resampling import longest_gap, split_segments
from s2c2a.logs.rests import from_rests, possible_rests
from s2c2a.logs.rig import (
    KEY,
    Rig,
    check_arm,
    transform_states,
)
from s2c2a.logs.rotation_changes import (
    describe_rotations,
    other_readings,
    without_rotations,
)
from s2c2a.logs.stated_values import (
    describe_contradictions,
    keeps_angles,
    still_drives,
    undetermined_numbers,
    unusual_numbers,
)
from s2c2a.logs.tables import ColumnRequest, Table
from s2c2a.logs.take import LogTake, build_take, effective_drives
from s2c2a.logs.take_change import TakeChange, find_change
from s2c2a.logs.unit_checks import drive_unit_change
from s2c2a.spaces import POSITION

# largest distance of an end from the base, in arm lengths, even if a camera has moved
MAX_REACH = 10.0
READING = "reading the logs"
COMPARING = "comparing the fit with the map"
CONTRADICTION = "the map contradicts the log: "
# in ten logs, fits without gravity cost at most a sixth more
NO_GRAVITY = "arm.gravity_direction: an upright arm is assumed; state it if it hangs"


@dataclass(frozen=True)
class Segments:
    """What was read of logs: segments of all takes.

    Attributes:
        takes: one take for each segment.
        rows: number of rows that were read.
        broken_rows: number of unreadable rows among them.
        excluded: poses that are excluded.
        frame_motions: jumps and drifts of the frame.
        clocks: clocks of later files of each take, if files are joined by time.
    """

    takes: list[LogTake]
    rows: int
    broken_rows: int
    excluded: Excluded
    frame_motions: tuple[FrameMotion, ...]
    clocks: tuple[tuple[LogClock, ...], ...] = ()


@dataclass(frozen=True)
class Imported:
    """Result of an import.

    Attributes:
        arm: identified or stated arm.
        text: text of its arm file, with the uncertainty of each number.
        episodes: episodes, base frame.
        rig: placement of cameras and motors.
        layout: drives of the arm's cables.
        fit: fitted cable model.
        assignment: modules and signs of the motors.
        residual: rms distance of the model's ends from the measured ones [m].
        at_rest: whether every row is a pose at rest.
        ambiguities: what the log does not determine.
        segments: what was read.
        diagnosis: change of the map under which the log fits clearly better; empty if
            there is none.
        poor_fit: what a fit that no change of the map explains misses, and what to
            check; empty for others.
        contradictions: stated values that the log contradicts; empty if there is none.
        undetermined: numbers that neither the log nor the map determines.
        unusual: numbers that are far from what the ends show, or from stated ones.
    """

    arm: ArmSpec
    text: str
    episodes: tuple[Episode, ...]
    rig: Rig
    layout: CableLayout
    fit: CableFit
    assignment: Assignment
    residual: float
    at_rest: bool
    ambiguities: tuple[str, ...]
    segments: Segments
    diagnosis: str
    poor_fit: str
    contradictions: str
    undetermined: tuple[str, ...]
    unusual: tuple[str, ...]

    @property
    def interpolated(self) -> str:
        """Steps and rows, where most steps lie between rows; else empty."""
        steps = sum(len(episode) for episode in self.episodes)
        if steps <= 2 * self.segments.rows:
            return ""
        return f"{counted(steps, 'step')} from {counted(self.segments.rows, 'row')}"


def import_logs(
    paths: Sequence[str | os.PathLike],
    log_map: LogMap,
    arm: ArmSpec | None = None,
    progress: Progress = quiet,
) -> Imported:
    """Read logs and identify the base frame and the cables.

    Args:
        paths: log files; each is a take, or as many as the map joins.
        log_map: the map.
        arm: arm to use instead of the identified one; its cables are matched with the
            identified ones.
        progress: see `Progress`.

    Raises:
        LogError: a file cannot be used or has too little data, or the map describes
            another arm.
    """
    if arm is not None:
        check_arm(arm, log_map)
    progress(READING, 0, 1)
    tables = _read_tables(paths, log_map)
    read = _build_takes(tables, log_map)
    for take in read:  # of rows in another unit of time, no fit says more
        longest_gap(take, log_map.rows, 1 / log_map.arm.control_rate)
    progress(READING, 1, 1)
    try:
        fitted = _fit(read, log_map, progress)
        progress(COMPARING, 0, 1)
        try:
            imported = _describe(fitted, log_map, arm)
        except ArmError as error:  # no arm is like it: the map is wrong
            explain = _Explanation(fitted.takes, fitted.rests, fitted)
            sentence = explain.single_change(log_map)
            advice = "check what the map states of the arm, or state its arm.lengths"
            raise LogError(f"{error}\n{sentence or advice}") from error
    except S2C2AError as error:
        sentence = _diagnose_rotations(tables, log_map, read)
        if sentence:
            raise LogError(f"{error}\n{sentence}") from None
        raise
    is_poor = imported.diagnosis or imported.poor_fit
    if is_poor and (sentence := _diagnose_rotations(tables, log_map, read)):
        imported = replace(imported, diagnosis=sentence, poor_fit="")
    progress(COMPARING, 1, 1)
    return imported


class _Fitted(NamedTuple):
    """Fit of the cable model, and what it was fitted to."""

    takes: list[LogTake]
    rests: np.ndarray
    segments: Segments
    observations: Observations
    start: CableParameters
    fit: CableFit
    assignment: Assignment
    ambiguities: list[str]
    layout: CableLayout


def _diagnose_rotations(
    tables: Sequence[Table], log_map: LogMap, read: Sequence[LogTake]
) -> str:
    """Sentence on another reading of the rotations; empty if they are not at fault."""
    plain = without_rotations(log_map)
    if plain == log_map or not all(np.isfinite(take.axes).any() for take in read):
        return ""
    positions = [replace(take, axes=np.full_like(take.axes, np.nan)) for take in read]
    try:
        fitted = _fit(positions, plain)
        imported = _describe(fitted, plain, None)
    except S2C2AError:
        return ""
    if imported.poor_fit or imported.diagnosis:
        return ""
    others = []
    for clause, ends in other_readings(log_map.ends):
        other_map = log_map.model_copy(update={"ends": ends})
        try:
            others.append((clause, _build_takes(tables, other_map)))
        except S2C2AError:
            continue
    stated = [from_rests(take, fitted.rests) for take in read]
    return describe_rotations(
        stated, others, log_map, fitted.observations.axes, fitted.fit
    )


def _fit(
    read: Sequence[LogTake], log_map: LogMap, progress: Progress = quiet
) -> _Fitted:
    """Fit the cable model, with those of the possible rests that fit best."""
    fits = []
    for rests in possible_rests(read, log_map):
        takes = [from_rests(take, rests) for take in read]
        try:
            fits.append(_fit_takes(takes, rests, log_map, progress))
        except S2C2AError as error:
            failure = error
            failed = takes, rests
    if fits:
        return min(fits, key=lambda fitted: fitted.fit.cost)
    if sentence := _Explanation(*failed).single_change(log_map):
        # the failure names what does not fit the wrong map
        raise LogError(sentence) from failure
    values = [effective_drives(take, log_map) for take in failed[0]]
    if still := still_drives(np.concatenate(values), log_map):
        names = ", ".join(still)
        verb = "moves" if len(still) == 1 else "move"
        raise LogError(
            f"{names} hardly {verb}: record motion of every drive\n{failure}"
        )
    raise failure


def _fit_takes(
    takes: list[LogTake], rests: np.ndarray, log_map: LogMap, progress: Progress
) -> _Fitted:
    """Fit the cable model to takes whose drives count from their rests."""
    segments, observations, start = _observe(takes, log_map)
    if fault := excess_travel(observations, log_map):
        raise LogError(fault)
    found = identify_cables(observations, start, log_map, progress)
    layout = build_layout(*found[:2], log_map)
    return _Fitted(takes, rests, segments, observations, start, *found, layout)


def _observe(
    takes: list[LogTake], log_map: LogMap
) -> tuple[Segments, Observations, CableParameters]:
    """Segments, their rows as observations, and the first guess of the model."""
    segments = _build_segments(takes, log_map)
    positions = np.concatenate([take.positions for take in segments.takes])
    registration = estimate_registration(positions, log_map)
    length = float(registration.lengths.sum())
    columns = np.concatenate(
        [effective_drives(take, log_map) for take in segments.takes]
    )
    observations = Observations(
        columns,
        _measured_states(segments.takes, log_map),
        registration.axes,
        log_map.by_force,
        prior_std(log_map),
        length,
        stated_bounds(registration, log_map),
    )
    return segments, observations, first_guess(registration, log_map)


def _shown_directions(takes: list[LogTake], log_map: LogMap) -> list[Change]:
    ends = np.concatenate([take.positions for take in takes])
    return other_directions(log_map, estimate_z(ends, log_map))


@dataclass
class _Explanation:
    """Changed maps that explain a log clearly better.

    Attributes:
        takes: takes whose drives count from their rests.
        rests: these rests.
        known: fit with the map as given; None if it has failed.
        clearly: largest cost of a change, relative to that of `known`.
        close: what maps miss that explain it about as well as stated, by clause.
        found: cost, clause and missed share of each that explains it clearly better.
    """

    takes: list[LogTake]
    rests: np.ndarray
    known: _Fitted | None = None
    clearly: float = CLEARLY
    close: dict[str, str] = field(default_factory=dict)
    found: list[tuple[float, str, float]] = field(default_factory=list)

    def __post_init__(self):
        known = self.known
        self._cost = _cost(known) if known else np.inf
        self._missed = missed_share(known.fit, known.observations) if known else np.inf

    def single_change(self, log_map: LogMap) -> str:
        """Sentence on the changes, of all that are known, that explain the log best.

        Each thing that the map states is changed or left to the log alone, and then all
        of them together.
        """
        values = [effective_drives(take, log_map) for take in self.takes]
        still = still_drives(np.concatenate(values), log_map)
        for tries in () if still else (self._angles, self._sizes):
            tries(log_map)
            if any(missed < POOR for _, _, missed in self.found):
                return self.sentence()  # all else that is stated explains the log
        self.whole(log_map, _shown_directions(self.takes, log_map))
        fault = self.drives(log_map)
        if still:
            return self.sentence() or fault  # without motion, anything explains it
        changes = [
            reversed_drives(log_map),
            reversed_modules(log_map),
            unstated_lengths(log_map),
            settled_rows(log_map),
        ]
        if any(drive.measured is None for drive in log_map.drives):
            changes.append(other_commands(log_map))
        self.whole(log_map, changes)
        self._all(log_map)
        return self.sentence() or fault

    def whole(self, log_map: LogMap, changes: Sequence[Change]) -> None:
        """Try what concerns all drives or ends.

        No search passes from one of the values to another, so that each is fitted from
        its own start.
        """
        for clause, changed in changes:
            if changed == log_map:  # nothing of it is stated
                continue
            for takes, rests in self._rested(changed):
                self._tries(clause, changed, takes, rests)

    def drives(self, log_map: LogMap) -> str:
        """Try single wrong drives; returns a sentence on one that moves too far."""
        try:
            _, observations, _ = _observe(self.takes, log_map)
        except S2C2AError:
            return ""
        if fault := excess_travel(observations, log_map):
            return fault
        clause, rescaled = foreign_units(observations, log_map)
        for factors in rescaled:
            scaled = [
                replace(
                    take,
                    commanded=factors * take.commanded,
                    measured=factors * take.measured,
                )
                for take in self.takes
            ]
            self._tries(clause, log_map, scaled, factors * self.rests)
        if not still_drives(observations.columns, log_map):
            for clause, changed in likely_changes(observations, log_map):
                self._tries(clause, changed, self.takes, self.rests)
        return ""

    def _angles(self, log_map: LogMap) -> None:
        """Try what makes stated angles equal those that the log shows without them."""
        free = unstated_angles(log_map)
        if free == log_map:
            return
        for fit in self._fits(free):
            for clause in find_changes(fit.found, log_map):
                self._adds(clause, fit.cost, fit.missed)

    def _sizes(self, log_map: LogMap) -> None:
        """Try the unit in which the sizes that the log shows without any are possible.

        The ends count in a unit in which they move like those of most arms.
        """
        free = unstated_sizes(log_map)
        ends = np.concatenate([take.positions for take in self.takes])
        try:
            scale = free_scale(ends)
        except LogError:
            return
        for fit in self._fits(free, scale):
            self._adds_unit(fit, log_map)

    def _fits(self, free: LogMap, scale: float = 1.0) -> Iterator[FreeFit]:
        """Fits of a map to ends divided by a scale, from each rest that it allows."""
        for takes, rests in self._rested(free):
            scaled = [replace(take, positions=take.positions / scale) for take in takes]
            try:
                fitted = _fit_takes(scaled, rests, free, quiet)
            except S2C2AError:
                continue
            observations = fitted.observations
            axes = observations.axes
            found = Identified.of(fitted.fit, fitted.assignment, axes, scale)
            missed = missed_share(fitted.fit, observations)
            yield FreeFit(found, missed, _cost(fitted) * scale**2)

    def _adds_unit(self, free: FreeFit, log_map: LogMap) -> bool:
        """Add another unit alone: sizes show it where no fit does."""
        is_better = self._is_better(free.cost, free.missed)
        unit = unit_change(free, is_better, log_map)
        if unit:
            self.found = [(free.cost, unit, free.missed)]
        return bool(unit)

    def _all(self, log_map: LogMap) -> None:
        """Try what makes all that is stated equal what the log shows without it."""
        fits = []
        for takes, _ in self._rested(log_map):
            try:
                fits.append(fit_freely(takes, log_map))
            except S2C2AError:
                continue
        if not fits:
            return
        free = min(fits, key=lambda fit: fit.cost)
        if self._adds_unit(free, log_map):
            return
        # all that is free explains most logs a little better
        if free.cost < AMBIGUOUS_RATIO * min(self.found, default=(np.inf,))[0]:
            for clause in find_changes(free.found, log_map):
                self._adds(clause, free.cost, free.missed)

    def _rested(self, log_map: LogMap) -> Iterator[tuple[list[LogTake], np.ndarray]]:
        """Takes that count from each rest that a map allows, and the rest.

        The arm is straight in other rows if it points elsewhere.
        """
        read = [from_rests(take, -self.rests) for take in self.takes]
        for rests in possible_rests(read, log_map):
            yield [from_rests(take, rests) for take in read], rests

    def _tries(
        self, clause: str, changed: LogMap, takes: list[LogTake], rests: np.ndarray
    ) -> None:
        """Fit a changed map to takes whose drives count from their rests."""
        try:
            fitted = _fit_takes(takes, rests, changed, quiet)
        except S2C2AError:
            return
        fit = fitted.fit
        axes = fitted.observations.axes
        identified = Identified.of(fit, fitted.assignment, axes)
        if contradicts_angles(identified, changed) and not keeps_angles(
            fit, fitted.observations, changed
        ):
            return
        share = missed_share(fit, fitted.observations)
        cost = _cost(fitted)
        if not self._adds(clause, cost, share) and AMBIGUOUS_RATIO * cost < self._cost:
            self.close[clause] = (
                f"misses {100 * share:.0f} % of the motion, and as stated "
                f"{100 * self._missed:.0f} %"
            )

    def _adds(self, clause: str, cost: float, missed: float) -> bool:
        """Add a change if it explains the log clearly better."""
        is_better = self._is_better(cost, missed)
        if is_better:
            self.found.append((cost, clause, missed))
        return is_better

    def _is_better(self, cost: float, missed: float) -> bool:
        # other cables can make up for one of another unit, at the cost of odd numbers
        fits_better = cost < self.clearly * self._cost
        misses_less = missed < CLEARLY * self._missed
        return missed < MOST and (fits_better or misses_less)

    def sentence(self) -> str:
        """The best of the changes, and those that are about as good; empty: none."""
        if not self.found:
            return ""
        least, _, share = min(self.found)
        # each once, whatever the number of its rests
        clauses = dict.fromkeys(
            clause for cost, clause, _ in self.found if AMBIGUOUS_RATIO * cost <= least
        )
        doubt = "; the log does not tell which" if len(clauses) > 1 else ""
        now = f"{100 * share:.0f} %"
        before = f"{100 * self._missed:.0f} %"
        better = f"; the model then misses {now} of the motion"
        if self.known:
            better = f"{better}, not {before}" if now != before else ""
        return f"{CONTRADICTION}{', or '.join(clauses)}{doubt}{better} (nothing was changed)"


def _cost(fitted: _Fitted) -> float:
    """Cost of a fit [m^2], whatever the length of its arm."""
    return fitted.fit.cost * fitted.observations.scale**2


def _describe(fitted: _Fitted, log_map: LogMap, arm: ArmSpec | None) -> Imported:
    """Arm, episodes, and what a fit says of the log and the map."""
    segments = fitted.segments
    observations = fitted.observations
    fit = fitted.fit
    assignment = fitted.assignment
    layout = fitted.layout
    bends, states = predict_states(
        fit.parameters, fit.wiring, observations.columns, observations.tension
    )
    base = np.asarray(fit.parameters.base)
    axes = (observations.axes @ np.asarray(tilt_rotation(fit.parameters.tilt))).T
    errors = states - transform_states(observations.states, base, axes)
    squares = np.sum(errors[..., POSITION] ** 2, axis=-1)
    residual = float(np.sqrt(np.nanmean(squares)))
    commands = [layout.cables(take.commands) for take in segments.takes]
    cables = layout.cables(observations.columns)
    text = format_arm(
        fit, assignment, layout, log_map, bends, commands, cables, residual
    )
    ambiguities = list(fitted.ambiguities)
    if arm is None:
        arm = arm_from_toml(text, "the identified arm")
        if "gravity_direction" not in log_map.arm.model_fields_set:
            ambiguities.append(NO_GRAVITY)
    else:
        text = arm_to_toml(arm)
        layout = match_layout(layout, arm, may_turn=log_map.frame.x is None)
    axes = _rotation_about_z(layout.turn) @ axes
    rig = Rig.identified(log_map, fitted.rests, layout.drive, layout.factor, base, axes)
    undetermined = undetermined_numbers(fit, observations.columns, log_map)
    unusual = unusual_numbers(fit, fitted.start, log_map)
    missed = missed_share(fit, observations)
    is_poor = missed > POOR
    wrong = ""
    # angles of a poor fit mean nothing
    if not is_poor and not keeps_angles(fit, observations, log_map):
        identified = Identified.of(fit, assignment, observations.axes)
        wrong = describe_angles(identified, log_map)
    # a map whose angles the fit leaves is to be equaled only
    most = 1 / AMBIGUOUS_RATIO if wrong else CLEARLY
    explain = _Explanation(fitted.takes, fitted.rests, fitted, most)
    gain = float(np.exp(fit.parameters.gain))
    lengths = np.exp(fit.parameters.lengths)
    if is_poor or wrong or drive_unit_change(gain, float(lengths.min()), log_map):
        diagnosis = explain.single_change(log_map)
    else:
        # modules and coupling hold for other signs, directions and lengths, too: a fit
        # takes a tenth of the time of the search that found them
        held = with_assignment(log_map, assignment)
        length = "arm.length" if log_map.arm.length else "arm.lengths"
        doubts = {
            f"{length}: {factor:g} times as long": other_length(held, factor)
            for factor in OTHER_LENGTHS
        }
        doubts["signs of all drives: reversed"] = reversed_drives(held)
        if any(drive.module is not None for drive in log_map.drives):
            doubts["order of modules: reversed"] = reversed_modules(log_map)
        directions = _shown_directions(fitted.takes, held)
        others = [unstated_lengths(held), settled_rows(held), *directions]
        explain.whole(held, [*doubts.values(), *others])
        # a drive of another unit hardly moves, or lets others seem to
        if unusual or still_drives(observations.columns, log_map):
            explain.drives(log_map)
        diagnosis = ""
        if explain.found:  # what explains more, without what is held, may be another
            diagnosis = explain.single_change(log_map)
        ambiguities += [
            f"{doubt}, the model {explain.close[clause]}; measure or check this on the arm"
            for doubt, (clause, _) in doubts.items()
            if clause in explain.close
        ]
    contradictions = [describe_contradictions(fit, observations), wrong]
    poor_fit = "" if diagnosis else describe_poor_fit(missed, log_map)
    return Imported(
        arm,
        text,
        _build_episodes(segments.takes, observations.states, arm, rig, log_map),
        rig,
        layout,
        fit,
        assignment,
        residual,
        log_map.rows.kind == "steps",
        tuple(ambiguities),
        segments,
        diagnosis,
        poor_fit,
        "; ".join(filter(None, contradictions)),
        tuple(undetermined),
        tuple(unusual),
    )


@dataclass(frozen=True)
class ImportedTake:
    """Another take of an arm, imported with the rig of the first one.

    Attributes:
        episodes: episodes, base frame.
        rig: rig of the first take.
        change: what explains the difference from the first take; None if too few
            rows can be compared.
        at_rest: whether every row is a pose at rest.
        segments: what was read.
    """

    episodes: tuple[Episode, ...]
    rig: Rig
    change: TakeChange | None
    at_rest: bool
    segments: Segments


def import_take(
    paths: Sequence[str | os.PathLike], log_map: LogMap, first: Recording
) -> ImportedTake:
    """Read logs of another take, with cameras and motors as in the first import.

    Args:
        paths: log files; each is a take, or as many as the map joins.
        log_map: the map, with the same drives.
        first: recording of the first import.

    Raises:
        LogError: a file cannot be used, the recording is not imported from a log, or
            the map describes another arm.
    """
    rig = Rig.of(first, log_map)
    read = _read_takes(paths, log_map)
    rests = np.array(rig.rests or np.zeros(len(rig.names)))
    segments = _build_segments([from_rests(take, rests) for take in read], log_map)
    states = _measured_states(segments.takes, log_map)
    episodes = _build_episodes(segments.takes, states, first.arm, rig, log_map)
    cables, positions = _cables_and_ends(episodes)
    reach = float(np.nanmax(np.abs(positions), initial=0.0))
    if reach > MAX_REACH * first.arm.length:
        raise LogError(
            f"ends are up to {reach:.3g} m from the base of an arm of "
            f"{first.arm.length:.3g} m, in the frame of the first recording; correct "
            "their unit in the map or, if cameras have moved, import the log "
            "without --like"
        )
    first_cables, first_positions = _cables_and_ends(first.episodes)
    change = find_change(cables, positions, first_cables, first_positions, first.arm)
    return ImportedTake(episodes, rig, change, log_map.rows.kind == "steps", segments)


def _cables_and_ends(episodes: Sequence[Episode]) -> tuple[np.ndarray, np.ndarray]:
    cables = np.concatenate([episode.sensor("cables") for episode in episodes])
    states = np.concatenate([episode.sensor("states") for episode in episodes])
    return cables, states[..., POSITION]


def save_imported(
    imported: Imported | ImportedTake, path: str | os.PathLike, options: dict[str, Any]
) -> Path | None:
    """Write the recording, and the arm file of an identified arm.

    Returns:
        Path of the arm file, if there is one.

    Raises:
        S2C2AError: a file cannot be written.
    """
    options = options | {
        "babbling": "imported log",
        "robot": "a log",
        "episodes": len(imported.episodes),
        "at_rest": imported.at_rest,
        KEY: imported.rig.model_dump(),
    }
    if clocks := imported.segments.clocks:
        options["clocks"] = [[clock.summary() for clock in each] for each in clocks]
    if isinstance(imported, ImportedTake):
        save_episodes(imported.episodes, path, options)
        return None
    options["residual_mm"] = round(1e3 * imported.residual, 2)
    save_episodes(imported.episodes, path, options)
    return write_atomically(imported.text, arm_file_of(path), LogError)


def arm_file_of(path: str | os.PathLike) -> Path:
    """Path of the arm file of a recording."""
    return Path(path).with_suffix(".arm.toml")


def _build_segments(read: list[LogTake], log_map: LogMap) -> Segments:
    """Exclude outliers, and split the takes into segments."""
    takes, excluded = exclude_outliers(read, log_map)
    period = 1 / log_map.arm.control_rate
    segments = []
    for take in takes:
        segments += split_segments(take, log_map.rows, period)
    if not segments:
        raise LogError(
            f"no episode is left of {counted(sum(map(len, takes)), 'row')}: nowhere do "
            f"{counted(log_map.rows.shortest, 'step')} follow each other; give a "
            "longer log, or check rows.unit, rows.longest_gap and rows.label"
        )
    rows = sum(len(take) for take in takes)
    broken_rows = sum(take.broken_rows for take in takes)
    motions = find_frame_motions(takes, log_map)
    clocks = tuple(take.clocks for take in takes if take.clocks)
    return Segments(segments, rows, broken_rows, excluded, motions, clocks)


def _files_of_take(log_map: LogMap) -> int:
    return log_map.join.files if log_map.join else 1


def _read_tables(paths: Sequence[str | os.PathLike], log_map: LogMap) -> list[Table]:
    count = _files_of_take(log_map)
    if not paths or len(paths) % count:
        raise LogError(
            f"{counted(len(paths), 'file')} given, and the map joins {count} to a take; "
            "give a multiple of that"
        )
    tables = []
    for index, path in enumerate(paths):
        place = index % count
        names = _names_in_file(log_map, place) if count > 1 else {}
        request = _request(log_map, place).in_file(names)
        tables.append(read_table(path, request).in_map(names))
    return tables


def _names_in_file(log_map: LogMap, place: int) -> dict[str, str]:
    """Name of a column in the map, such as `2:x` -> in the joined file at this place."""
    prefix = f"{place + 1}:"
    wanted = log_map.number_columns | log_map.label_columns
    return {
        name: name.removeprefix(prefix) for name in wanted if name.startswith(prefix)
    }


def _build_takes(tables: Sequence[Table], log_map: LogMap) -> list[LogTake]:
    count = _files_of_take(log_map)
    return [
        build_take(tables[begin : begin + count], log_map)
        for begin in range(0, len(tables), count)
    ]


def _read_takes(paths: Sequence[str | os.PathLike], log_map: LogMap) -> list[LogTake]:
    return _build_takes(_read_tables(paths, log_map), log_map)


def _request(log_map: LogMap, place: int) -> ColumnRequest:
    """Columns to read of the file at this place among those of a take."""
    skipped = log_map.rows.skip_lines
    topic = log_map.rows.topic
    return ColumnRequest(
        log_map.number_columns,
        log_map.label_columns,
        skipped[place] if isinstance(skipped, tuple) else skipped,
        log_map.rows.broken_rows == "gap",
        log_map.time_columns,
        topic[place] if isinstance(topic, tuple) else topic,
    )


def _measured_states(
    segments: Sequence[LogTake], log_map: LogMap
) -> Float[np.ndarray, "rows modules 6"]:
    """States [m, 1] in the frame of the log; NaN: not measured."""
    ends = np.concatenate(
        [
            np.concatenate([segment.positions, segment.axes], axis=-1)
            for segment in segments
        ]
    )
    states = np.full((len(ends), log_map.arm.modules, 6), np.nan)
    states[:, log_map.end_modules] = ends
    return states


def _rotation_about_z(angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation of a frame with its axes as rows."""
    cos = np.cos(angle)
    sin = np.sin(angle)
    return np.array(
        [
            [cos, -sin, 0.0],
            [sin, cos, 0.0],
            [0.0, 0.0, 1.0],
        ]
    )


def _build_episodes(
    segments: Sequence[LogTake],
    states: np.ndarray,
    arm: ArmSpec,
    rig: Rig,
    log_map: LogMap,
) -> tuple[Episode, ...]:
    """Episodes from segments, with states in the frame of the log."""
    ends = np.cumsum([len(segment) for segment in segments])
    split = np.split(rig.in_base(states), ends[:-1])
    return tuple(
        _build_episode(segment, rows, arm, rig, log_map)
        for segment, rows in zip(segments, split, strict=True)
    )


def _build_episode(
    segment: LogTake, states: np.ndarray, arm: ArmSpec, rig: Rig, log_map: LogMap
) -> Episode:
    """Episode of one segment, with states in the base frame.

    An episode's action takes effect in the next row. Settled rows have their own
    command, so commands are shifted by one row.
    """
    sent = segment.commands
    if log_map.by_force:  # noise of sensors; no command is below zero
        is_measured = [drive.commanded is None for drive in log_map.drives]
        sent = np.where(is_measured, np.maximum(sent, 0.0), sent)
    if log_map.rows.settled:
        sent = np.concatenate([sent[1:], sent[-1:]])
    columns = {
        "time": segment.time - segment.time[0],
        "actions": rig.cables(sent),
        "sensor.cables": rig.cables(effective_drives(segment, log_map)),
        "sensor.states": states,
    }
    label = str(segment.labels[0])
    return Episode(arm, columns, {"label": label} if label else {})
