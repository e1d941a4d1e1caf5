"""Least squares for the numbers of an arm file, beside what the file says of them.

With residuals r of the replayed arm, their variance v, and coordinates u of the numbers
(one a spread away from the file, `numbers.Unknown`), the fit is least |r(u)|^2 / v +
|u|^2: the likeliest arm, by the file and what was recorded. v comes from what a first
fit leaves; rows that follow each other and err alike count as fewer, since a twin errs
by what it does not model, and a thousand such rows say little more than one. What the
recording says of u is J^T J / v: eigenvalues below one belong to combinations that it
says less of than the file did.
"""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from s2c2a.arm import ArmSpec
from s2c2a.episodes import Episode
from s2c2a.executors import Serial, in_order
from s2c2a.identification.numbers import Unknown, arm_at
from s2c2a.identification.problem import (
    FitOptions,
    Problem,
    compared,
    framed,
    limits_of,
    problem_of,
    residuals,
    simulated,
)
from s2c2a.identification.replay import replayed
from s2c2a.progress import Progress, quiet
from s2c2a.spaces import States

STEP = 0.02  # spreads: finite differences
USUAL_WAY = FitOptions()
MIN_VARIANCE = 1e-12  # a recording of the simulation itself leaves nothing
ENOUGH = 1e-4  # relative change of the sum, or of the coordinates, at which it ends


@dataclass(frozen=True, eq=False)
class Belief:
    """What the recording says of the numbers.

    Attributes:
        names: of the coordinates.
        deviations: standard deviation of each coordinate, in spreads.
        information: eigenvalues of what the recording says, least first; below one:
            less than the file.
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
        finished: whether it came to an end by itself, not by the limit of rounds or an
            interrupt.
    """

    problem: Problem
    coordinates: Float[np.ndarray, " coordinates"]
    belief: Belief = field(repr=False)
    finished: bool

    @property
    def arm(self) -> ArmSpec:
        """The fitted arm."""
        return arm_at(
            self.problem.arm,
            self.problem.unknowns,
            self.coordinates[: len(self.problem.unknowns)],
        )

    def predicted(self, episodes: Sequence[Episode]) -> list[States]:
        """What the fitted arm does in these episodes, in the recording's frame."""
        states = replayed(self.arm, episodes, self.problem.options.replay)
        return [framed(self.problem, self.coordinates, one) for one in states]


def identify(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    episodes: Sequence[Episode],
    options: FitOptions = USUAL_WAY,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> Fit:
    """Fit an arm's numbers to what was recorded, but for what `problem.held_out` keeps.

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
    problem = problem_of(arm, unknowns, episodes, options)
    return _Search(problem, executor or Serial(), progress).done()


class _Search:
    """The way to the least sum of squares: where it is, with slopes there, and the variance that residuals have."""

    def __init__(self, problem: Problem, executor: Executor, progress: Progress):
        self._problem = problem
        self._executor = executor
        self._progress = progress
        self._round = 0
        self._there = _start(problem)
        self._variance = 1.0
        self._slopes = np.zeros((1, len(problem.names)))

    def done(self) -> Fit:
        """Go there twice, the second time with the variance that the first has left; an interrupt ends it early."""
        rounds = self._problem.options.rounds
        finished = False
        try:
            for share in (rounds - rounds // 2, rounds // 2):
                finished = self._gone(share) if share else finished
                self._variance = variance_of(
                    self._problem, residuals(self._problem, self._there)
                )
        except KeyboardInterrupt:
            if not self._round:
                raise
            finished = False
        self._progress("fitting", rounds, rounds)
        return Fit(
            self._problem,
            self._there,
            belief(self._problem, self._slopes, self._variance),
            finished,
        )

    def _gone(self, rounds: int) -> bool:
        """So many rounds at most; whether it came to an end before."""
        limits = limits_of(self._problem)
        found = least_squares(
            self._left,
            self._there,
            self._slopes_at,
            limits,
            ftol=ENOUGH,
            xtol=ENOUGH,
            max_nfev=rounds + 1,
        )
        self._there = found.x
        return bool(found.status > 0)

    def _left(self, coordinates: np.ndarray) -> np.ndarray:
        return np.concatenate(
            [
                residuals(self._problem, coordinates) / np.sqrt(self._variance),
                coordinates,
            ]
        )

    def _slopes_at(self, coordinates: np.ndarray) -> np.ndarray:
        """Asked for where the sum fell."""
        self._progress(
            "fitting",
            min(self._round, self._problem.options.rounds - 1),
            self._problem.options.rounds,
        )
        self._slopes = jacobian(self._problem, coordinates, self._executor)
        self._round = self._round + 1
        self._there = coordinates.copy()
        return np.vstack(
            [self._slopes / np.sqrt(self._variance), np.eye(len(coordinates))]
        )


def _start(problem: Problem) -> np.ndarray:
    """What the file says, and the frame that suits it: the arm may have been fitted before."""
    count = len(problem.unknowns)
    size = len(problem.names)
    states = simulated(problem, np.zeros(count)) if problem.options.frame else None
    if states is None:
        return np.zeros(size)

    def left(frame):
        return np.append(
            compared(problem, np.append(np.zeros(count), frame), states), frame
        )

    return np.append(np.zeros(count), least_squares(left, np.zeros(size - count)).x)


def jacobian(
    problem: Problem, coordinates: Float[np.ndarray, " coordinates"], executor: Executor
) -> Float[np.ndarray, "seen coordinates"]:
    """Slopes of the residuals by finite differences, away from the nearest limit."""
    count = len(problem.unknowns)
    high = limits_of(problem)[1]
    steps = np.where(coordinates + STEP > high, -STEP, STEP)
    moved = coordinates + np.diag(steps)  # a row a coordinate
    states = list(
        in_order(
            executor,
            partial(simulated, problem),
            [row[:count] for row in [coordinates, *moved[:count]]],
        )
    )
    here = compared(problem, coordinates, states[0])
    # a frame needs no arm
    there = states[1:] + [states[0]] * (len(coordinates) - count)
    ends = [compared(problem, row, one) for row, one in zip(moved, there, strict=True)]
    return ((np.array(ends) - here) / steps[:, None]).T


def belief(
    problem: Problem, slopes: Float[np.ndarray, "seen coordinates"], variance: float
) -> Belief:
    """How sure the coordinates are, from slopes and the variance of residuals."""
    information = slopes.T @ slopes / variance
    values, directions = np.linalg.eigh(information)
    deviations = np.sqrt(np.diag(np.linalg.inv(information + np.eye(len(information)))))
    return Belief(problem.names, deviations, values, directions.T)


def variance_of(problem: Problem, left: Float[np.ndarray, " seen"]) -> float:
    """Of the residuals that are left, as if rows that follow each other and are alike were fewer."""
    table = np.full(np.shape(np.concatenate(problem.seen)), np.nan)
    table[np.isfinite(np.concatenate(problem.seen))] = left
    rows = table.reshape(len(table), -1)
    alike = np.clip(
        np.nansum(rows[1:] * rows[:-1]) / max(np.nansum(rows**2), 1e-30), 0.0, 0.99
    )
    return max(
        float(
            left
            @ left
            / max(len(left) - len(problem.names), 1)
            * (1 + alike)
            / (1 - alike)
        ),
        MIN_VARIANCE,
    )
