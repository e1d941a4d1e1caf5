"""Least squares for the numbers of an arm file, beside what the file says of them.

With residuals r of the replayed arm in parts of what one expects of it, and coordinates u of the numbers (one a spread
away from the file, `numbers.Unknown`), the fit is least |r(u)|^2 + |u|^2 (a maximum a posteriori). What the recording
says of u is J^T J over the variance that is left, whose rows follow each other and so count as fewer: eigenvalues below
one belong to combinations that the recording says less of than the file did.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from jaxtyping import Float
from pydantic import ValidationError
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.data import Recording
from s2c2a.episodes import Episode
from s2c2a.errors import RecordingError, S2C2AError, SimulationError
from s2c2a.executors import Serial, in_order
from s2c2a.identification.numbers import Unknown, arm_at
from s2c2a.identification.replay import Replay, replayed
from s2c2a.progress import Progress, quiet
from s2c2a.spaces import AXIS, POSITION, States

EXPECTED = 0.01  # of the arm's length: residual of a twin that is worth its name
STEP = 0.02  # spreads: finite differences
ENOUGH = 1e-4  # relative change of the sum, or of the coordinates, at which it ends
FAILED = 100.0  # residual of an arm that cannot be or blows up, in what is expected
FRAME_SPREAD = np.array([0.1] * 3 + [0.05] * 3)  # rad, and parts of the length: how far off the recording's frame is
FRAME_NAMES = tuple(f"frame.{what}_{axis}" for what in ("turn", "shift") for axis in "xyz")
LONGEST_SETTLING = 60.0  # s
HELD_OUT, STRETCH = 5, 25  # every fifth stretch of 25 rows is kept from the fit


@dataclass(frozen=True)
class FitOptions:
    """How it is fitted.

    Attributes:
        replay: how the recording is gone through again.
        frame: whether the recording's frame may be off too, as that of an imported one.
        rounds: Jacobians at most.
    """

    replay: Replay = field(default_factory=Replay)
    frame: bool = False
    rounds: int = 12


def options_for(recording: Recording, settling: float | None, rounds: int, fidelity: str) -> FitOptions:
    """What suits a recording: an imported one may be registered wrongly, and its episodes follow each other.

    Args:
        recording: that is fitted to.
        settling: seconds that an action is held, where rows are shapes at rest.
        rounds: of the fit.
        fidelity: of the simulation.

    Raises:
        S2C2AError: numbers that are not positive.
    """
    if rounds < 1 or (settling is not None and not 0 < settling <= LONGEST_SETTLING):
        raise S2C2AError(
            f"{rounds} rounds and {settling} s to settle asked for; take at least one round, and up to "
            f"{LONGEST_SETTLING:g} s"
        )
    imported = recording.options.get("babbling") == "imported"
    return FitOptions(Replay(settling, imported, fidelity), imported, rounds)


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be explained, by which numbers; it travels to other processes.

    Attributes:
        arm: the start.
        unknowns: its numbers that are fitted.
        episodes: what was recorded.
        seen: states that the fit shall explain; NaN where nothing was seen or rows are kept from it.
        options: how.
    """

    arm: ArmSpec
    unknowns: tuple[Unknown, ...]
    episodes: tuple[Episode, ...]
    seen: tuple[States, ...]
    options: FitOptions

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""
        return tuple(one.name for one in self.unknowns) + (FRAME_NAMES if self.options.frame else ())


@dataclass(frozen=True, eq=False)
class Belief:
    """What the recording says of the numbers.

    Attributes:
        names: of the coordinates.
        deviations: standard deviation of each coordinate, in spreads.
        information: eigenvalues of what the recording says, least first; below one: less than the file.
        combinations: their directions, one a row.
    """

    names: tuple[str, ...]
    deviations: Float[np.ndarray, " coordinates"]
    information: Float[np.ndarray, " coordinates"]
    combinations: Float[np.ndarray, "coordinates coordinates"]


@dataclass(frozen=True, eq=False)
class Fit:
    """What came of it.

    Attributes:
        problem: that was solved.
        coordinates: of numbers, and of the frame where that was fitted.
        belief: how sure they are.
        finished: whether it came to an end by itself, not by the limit of rounds or an interrupt.
    """

    problem: Problem
    coordinates: Float[np.ndarray, " coordinates"]
    belief: Belief = field(repr=False)
    finished: bool

    @property
    def arm(self) -> ArmSpec:
        """The fitted arm."""
        return arm_at(self.problem.arm, self.problem.unknowns, self.coordinates[: len(self.problem.unknowns)])

    def predicted(self, episodes: Sequence[Episode]) -> list[States]:
        """What the fitted arm does in these episodes, in the recording's frame."""
        states = replayed(self.arm, episodes, self.problem.options.replay)
        return [_framed(self.problem, self.coordinates, one) for one in states]


def identify(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    episodes: Sequence[Episode],
    options: FitOptions = FitOptions(),
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> Fit:
    """Fit an arm's numbers to what was recorded, but for what `held_out` keeps.

    An interrupt ends it with the best so far.

    Args:
        arm: the start; it must be of the same form as the one that was recorded.
        unknowns: numbers of it that are fitted.
        episodes: with the sensor `states`; NaN: not seen.
        options: how.
        executor: works out columns of the Jacobian side by side.
        progress: told rounds.

    Raises:
        RecordingError: no state was seen.
    """
    kept = held_out(episodes, options.replay.one_session)
    seen = tuple(
        np.where(rows[:, None, None], np.nan, one.sensor("states")) for rows, one in zip(kept, episodes, strict=True)
    )
    if not any(np.isfinite(one).any() for one in seen):
        raise RecordingError("nothing was seen of this arm's ends, so nothing can be fitted; record `states` too")
    problem = Problem(arm, tuple(unknowns), tuple(episodes), seen, options)
    return _Search(problem, executor or Serial(), progress).done()


def held_out(episodes: Sequence[Episode], one_session: bool = False) -> list[np.ndarray]:
    """Which rows are kept from the fit: every fifth stretch of 25, counted through all episodes; shapes (rows,).

    Beside them the first row of every episode, since what came before it is not known; in one session of the first.
    """
    ends = np.cumsum([len(one) for one in episodes])
    kept = np.split(np.arange(ends[-1]) // STRETCH % HELD_OUT == HELD_OUT - 1, ends[:-1])
    return [rows | unknown for rows, unknown in zip(kept, begun(episodes, one_session), strict=True)]


def begun(episodes: Sequence[Episode], one_session: bool = False) -> list[np.ndarray]:
    """Rows that count for nothing, since what came before them is not known; shapes (rows,)."""
    return [(np.arange(len(one)) == 0) & (number == 0 or not one_session) for number, one in enumerate(episodes)]


class _Search:
    """The way to the least sum of squares: where it is, with slopes and what is left there."""

    def __init__(self, problem: Problem, executor: Executor, progress: Progress):
        self._problem, self._executor, self._progress = problem, executor, progress
        self._round, self._there = 0, _start(problem)
        self._slopes = np.zeros((1, len(problem.names)))

    def done(self) -> Fit:
        """Go there; an interrupt after the first round ends it early."""
        finished, rounds, limits = False, self._problem.options.rounds, limits_of(self._problem)
        try:
            found = least_squares(
                self._left, self._there, self._slopes_at, limits, ftol=ENOUGH, xtol=ENOUGH, max_nfev=rounds + 1
            )
            self._there, finished = found.x, found.status > 0
        except KeyboardInterrupt:
            if not self._round:
                raise
        self._progress("fitting", rounds, rounds)
        left = residuals(self._problem, self._there)
        return Fit(self._problem, self._there, belief(self._problem, left, self._slopes), finished)

    def _left(self, coordinates: np.ndarray) -> np.ndarray:
        return np.concatenate([residuals(self._problem, coordinates), coordinates])

    def _slopes_at(self, coordinates: np.ndarray) -> np.ndarray:
        """Asked for where the sum fell."""
        self._progress("fitting", self._round, self._problem.options.rounds)
        self._slopes = jacobian(self._problem, coordinates, self._executor)
        self._round, self._there = self._round + 1, coordinates.copy()
        return np.vstack([self._slopes, np.eye(len(coordinates))])


def _start(problem: Problem) -> np.ndarray:
    """What the file says, and the frame that suits it: the arm may have been fitted before."""
    count, size = len(problem.unknowns), len(problem.names)
    states = simulated(problem, np.zeros(count)) if problem.options.frame else None
    if states is None:
        return np.zeros(size)

    def left(frame):
        return np.append(_compared(problem, np.append(np.zeros(count), frame), states), frame)

    return np.append(np.zeros(count), least_squares(left, np.zeros(size - count)).x)


def limits_of(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Least and largest coordinates; a start on its limit is within."""
    sides = np.array([one.bounds for one in problem.unknowns]).reshape(-1, 2)
    frame = np.full((len(problem.names) - len(sides), 2), [-np.inf, np.inf])
    low, high = np.concatenate([sides, frame]).T
    return np.minimum(low, -1e-9), np.maximum(high, 1e-9)


def residuals(problem: Problem, coordinates: Float[np.ndarray, " coordinates"]) -> Float[np.ndarray, " seen"]:
    """Differences of states, in parts of what is expected; a large one each where the arm cannot be."""
    return _compared(problem, coordinates, simulated(problem, coordinates[: len(problem.unknowns)]))


def simulated(problem: Problem, coordinates: Float[np.ndarray, " unknowns"]) -> list[States] | None:
    """What the arm at these coordinates does, none where it cannot be or blows up."""
    try:
        arm = arm_at(problem.arm, problem.unknowns, coordinates)
        return replayed(arm, problem.episodes, problem.options.replay)
    except (SimulationError, ValidationError):
        return None


def _compared(problem: Problem, coordinates: np.ndarray, states: list[States] | None) -> np.ndarray:
    seen = np.concatenate(problem.seen)
    if states is None:
        return np.full(np.isfinite(seen).sum(), FAILED)
    apart = np.concatenate([_framed(problem, coordinates, one) for one in states]) - seen
    expected = EXPECTED * problem.arm.length
    apart[..., POSITION] /= expected
    apart[..., AXIS] *= per_module(problem.arm, "length").mean() / expected
    return apart[np.isfinite(seen)]


def _framed(problem: Problem, coordinates: np.ndarray, states: States) -> States:
    """States as they look in the recording's frame."""
    if not problem.options.frame:
        return states
    moved = FRAME_SPREAD * coordinates[len(problem.unknowns) :]
    turn, shift = Rotation.from_rotvec(moved[:3]).as_matrix(), moved[3:] * problem.arm.length
    return np.concatenate([states[..., POSITION] @ turn.T + shift, states[..., AXIS] @ turn.T], axis=-1)


def jacobian(
    problem: Problem, coordinates: Float[np.ndarray, " coordinates"], executor: Executor
) -> Float[np.ndarray, "seen coordinates"]:
    """Slopes of the residuals by finite differences, away from the nearest limit."""
    count, high = len(problem.unknowns), limits_of(problem)[1]
    steps = np.where(coordinates + STEP > high, -STEP, STEP)
    moved = coordinates + np.diag(steps)  # a row a coordinate
    states = list(
        in_order(executor, partial(simulated, problem), [row[:count] for row in [coordinates, *moved[:count]]])
    )
    here = _compared(problem, coordinates, states[0])
    there = states[1:] + [states[0]] * (len(coordinates) - count)  # a frame needs no arm
    ends = [_compared(problem, row, one) for row, one in zip(moved, there, strict=True)]
    return ((np.array(ends) - here) / steps[:, None]).T


def belief(problem: Problem, left: Float[np.ndarray, " seen"], slopes: Float[np.ndarray, "seen coordinates"]) -> Belief:
    """How sure the coordinates are, from slopes and what is left."""
    information = slopes.T @ slopes / max(_variance(problem, left), 1e-12)
    values, directions = np.linalg.eigh(information)
    deviations = np.sqrt(np.diag(np.linalg.inv(information + np.eye(len(information)))))
    return Belief(problem.names, deviations, values, directions.T)


def _variance(problem: Problem, left: np.ndarray) -> float:
    """Of what is left, as if rows that follow each other and are alike were fewer."""
    table = np.full(np.shape(np.concatenate(problem.seen)), np.nan)
    table[np.isfinite(np.concatenate(problem.seen))] = left
    rows = table.reshape(len(table), -1)
    alike = np.clip(np.nansum(rows[1:] * rows[:-1]) / max(np.nansum(rows**2), 1e-30), 0.0, 0.99)
    return float(left @ left / max(len(left) - len(problem.names), 1) * (1 + alike) / (1 - alike))
