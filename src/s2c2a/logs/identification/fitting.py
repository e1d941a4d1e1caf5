"""Maximum-a-posteriori fit of the numbers of an arm file to a recording.

Let r be the residuals of the replayed arm, v their variance, and u the coordinates of
the numbers, in prior standard deviations from the file (`numbers.Unknown`). The fit
minimizes |r(u)|^2 / v + |u|^2. A first fit estimates v. Successive rows with similar
residuals count as fewer rows, because the model error is correlated in time. The
information of the recording is J^T J / v: eigenvalues below one belong to combinations
of numbers that the prior determines better than the recording.
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
from s2c2a.execution.executors import Serial, in_order
from s2c2a.execution.progress import Progress, quiet
from s2c2a.logs.identification.numbers import Unknown, arm_at
from s2c2a.logs.identification.problem import (
    FitProblem,
    IdentificationOptions,
    build_problem,
    coordinate_bounds,
    residuals,
    residuals_of,
    simulate,
    to_recording_frame,
)
from s2c2a.logs.identification.replay import replayed
from s2c2a.spaces import States

PerCoordinate = Float[np.ndarray, " coordinates"]
STEP = 0.02  # step of finite differences, in prior standard deviations
DEFAULT_OPTIONS = IdentificationOptions()
MIN_VARIANCE = 1e-12  # a recording of the simulation itself leaves no residual
TOLERANCE = 1e-4  # relative change of the cost, or of the coordinates, at convergence
MAX_CORRELATION = 0.99


@dataclass(frozen=True, eq=False)
class Posterior:
    """Uncertainty of the fitted coordinates.

    Attributes:
        names: names of the coordinates.
        std: standard deviation of each coordinate, in prior standard deviations.
        information: eigenvalues of the information of the recording, ascending; below
            one, the prior is more informative.
        combinations: eigenvectors, one in each row.
    """

    names: tuple[str, ...]
    std: PerCoordinate
    information: PerCoordinate
    combinations: Float[np.ndarray, "coordinates coordinates"]


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit.

    Attributes:
        problem: the problem.
        coordinates: coordinates of the numbers, and of the frame if it is fitted.
        posterior: their uncertainty.
        finished: whether the fit converged, before the limit of rounds or an interrupt.
    """

    problem: FitProblem
    coordinates: PerCoordinate
    posterior: Posterior = field(repr=False)
    finished: bool

    @property
    def arm(self) -> ArmSpec:
        """The fitted arm."""
        unknowns = self.problem.unknowns
        return arm_at(self.problem.arm, unknowns, self.coordinates[: len(unknowns)])

    def predicted(self, episodes: Sequence[Episode]) -> list[States]:
        """States of the fitted arm in episodes, in the recording's frame."""
        simulated = replayed(self.arm, episodes, self.problem.options.replay)
        return [
            to_recording_frame(self.problem, self.coordinates, states)
            for states in simulated
        ]


def identify(
    arm: ArmSpec,
    unknowns: Sequence[Unknown],
    episodes: Sequence[Episode],
    options: IdentificationOptions = DEFAULT_OPTIONS,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> Fit:
    """Fit an arm's numbers to all rows but those of `problem.held_out`.

    An interrupt after the first round ends the fit with the best result so far.

    Args:
        arm: start of the fit, with as many modules and cables as the recorded arm.
        unknowns: numbers to fit.
        episodes: episodes with the sensor `states`; NaN: not measured.
        options: options of the fit.
        executor: computes columns of the Jacobian in parallel.
        progress: callback after each round.

    Raises:
        RecordingError: no state is measured.
    """
    problem = build_problem(arm, unknowns, episodes, options)
    return _Optimizer(problem, executor or Serial(), progress).run()


class _Optimizer:
    """Least-squares search, with the best coordinates and Jacobian so far."""

    def __init__(self, problem: FitProblem, executor: Executor, progress: Progress):
        self._problem = problem
        self._executor = executor
        self._progress = progress
        self._round = 0
        self._coordinates = _start(problem)
        self._variance = 1.0
        self._residual_jacobian = np.zeros((1, len(problem.names)))

    def run(self) -> Fit:
        """Minimize twice, the second time with the variance after the first."""
        problem = self._problem
        rounds = problem.options.rounds
        finished = False
        try:
            for count in (rounds - rounds // 2, rounds // 2):
                if count:
                    # run at most this many rounds; return whether they converged
                    result = least_squares(
                        self._cost_terms,
                        self._coordinates,
                        self._jacobian,
                        coordinate_bounds(self._problem),
                        ftol=TOLERANCE,
                        xtol=TOLERANCE,
                        max_nfev=count + 1,
                    )
                    self._coordinates = result.x
                    finished = bool(result.status > 0)
                errors = residuals(problem, self._coordinates)
                self._variance = estimate_variance(problem, errors)
        except KeyboardInterrupt:
            if not self._round:
                raise
            finished = False
        self._progress("fitting", rounds, rounds)
        posterior = estimate_posterior(problem, self._residual_jacobian, self._variance)
        return Fit(problem, self._coordinates, posterior, finished)

    def _cost_terms(self, coordinates: np.ndarray) -> np.ndarray:
        errors = residuals(self._problem, coordinates) / np.sqrt(self._variance)
        return np.concatenate([errors, coordinates])

    def _jacobian(self, coordinates: np.ndarray) -> np.ndarray:
        """Jacobian of the cost terms; called where the cost has fallen."""
        rounds = self._problem.options.rounds
        self._progress("fitting", min(self._round, rounds - 1), rounds)
        self._residual_jacobian = jacobian(self._problem, coordinates, self._executor)
        self._round += 1
        self._coordinates = coordinates.copy()
        scaled = self._residual_jacobian / np.sqrt(self._variance)
        return np.vstack([scaled, np.eye(len(coordinates))])


def _start(problem: FitProblem) -> np.ndarray:
    """Coordinates of the file, with the frame fitted to the recording."""
    count = len(problem.unknowns)
    size = len(problem.names)
    start = np.zeros(size)
    if not problem.options.frame:
        return start
    states = simulate(problem, start[:count])
    if states is None:
        return start

    def cost_terms(frame):
        coordinates = np.append(start[:count], frame)
        return np.append(residuals_of(problem, coordinates, states), frame)

    start[count:] = least_squares(cost_terms, start[count:]).x
    return start


def jacobian(
    problem: FitProblem,
    coordinates: PerCoordinate,
    executor: Executor,
) -> Float[np.ndarray, "measured coordinates"]:
    """Jacobian of the residuals by finite differences, within the bounds."""
    count = len(problem.unknowns)
    high = coordinate_bounds(problem)[1]
    steps = np.where(coordinates + STEP > high, -STEP, STEP)
    stepped = coordinates + np.diag(steps)
    points = [row[:count] for row in [coordinates, *stepped[:count]]]
    states = list(in_order(executor, partial(simulate, problem), points))
    base = residuals_of(problem, coordinates, states[0])
    # coordinates of the frame need no simulation
    frame_count = len(coordinates) - count
    stepped_states = states[1:] + [states[0]] * frame_count
    errors = [
        residuals_of(problem, row, row_states)
        for row, row_states in zip(stepped, stepped_states, strict=True)
    ]
    return ((np.array(errors) - base) / steps[:, None]).T


def estimate_posterior(
    problem: FitProblem,
    residual_jacobian: Float[np.ndarray, "measured coordinates"],
    variance: float,
) -> Posterior:
    """Uncertainty of the coordinates, from the Jacobian and variance of residuals."""
    information = residual_jacobian.T @ residual_jacobian / variance
    values, directions = np.linalg.eigh(information)
    covariance = np.linalg.inv(information + np.eye(len(information)))
    std = np.sqrt(np.diag(covariance))
    return Posterior(problem.names, std, values, directions.T)


def estimate_variance(
    problem: FitProblem, errors: Float[np.ndarray, " measured"]
) -> float:
    """Variance of the residuals, increased for the correlation of successive rows."""
    measured = np.concatenate(problem.measured)
    table = np.full(measured.shape, np.nan)
    table[np.isfinite(measured)] = errors
    rows = table.reshape(len(table), -1)
    products = np.nansum(rows[1:] * rows[:-1])
    correlation = products / max(np.nansum(rows**2), 1e-30)
    correlation = np.clip(correlation, 0.0, MAX_CORRELATION)
    freedom = max(len(errors) - len(problem.names), 1)
    variance = errors @ errors / freedom * (1 + correlation) / (1 - correlation)
    return max(float(variance), MIN_VARIANCE)
