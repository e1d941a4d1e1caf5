r"""Least squares of offset, drift, lag and backlash between drives and ends.

The ends are a smooth function of the drives after backlash and a first-order lag,

$$ y(t) = W \, \phi(x_\tau(s)), \qquad s = t + o + d (t - t_m), $$

with offset o, drift d and lag tau; W is eliminated (variable projection).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import lstsq, solve
from scipy.optimize import approx_fprime, least_squares

from s2c2a.logs.drive_features import MAX_FITTED, DriveFeatures
from s2c2a.logs.interpolation import evenly_spread, is_near
from s2c2a.logs.timed_motion import TimedMotion

MIN_ROWS = 60
"""Rows with known drives and ends; fewer hardly hold the blocks of the deviation."""
LONGEST_GAP = 4.0  # rows of the ends in longer gaps of the drives are not fitted, rows
BLOCKS = 20  # stretches of the log whose scatter gives the deviation
WIDTH_SCALE = 0.2  # of the backlash in the optimization
DIFFERENCE = 0.02
"""Steps of differences, relative to the scales, so that they span interpolated rows."""
OUTLIER = 3.0  # error from which rows weigh less, relative to the median
RIDGE = 1e-8  # relative; features of antagonistic drives are nearly equal
MAX_EVALUATIONS = 20
PASSES = 3  # fits, each with the outliers of the one before
LOWEST = (-np.inf, -np.inf, 0.0, 0.0)
HIGHEST = (np.inf, np.inf, np.inf, 1.0)


class ClockParameters(NamedTuple):
    """Parameters of the fit.

    Attributes:
        offset: clock of the drives minus that of the ends [s], at the ends' middle.
        drift: seconds that the first clock gains per second of the later one.
        lag: time constant with which the ends follow the drives [s].
        width: half width of the backlash, relative to a drive's travel.
    """

    offset: float
    drift: float
    lag: float
    width: float


class ClockFit(NamedTuple):
    """Result of a fit.

    Attributes:
        parameters: the best ones.
        explained: share of the variance that is explained in stretches that are not
            fitted.
        problem: what is fitted.
        weights: of its rows.
    """

    parameters: ClockParameters
    explained: float
    problem: "ClockProblem"
    weights: Float[np.ndarray, " rows"]


class ClockProblem:
    """Residuals of the ends, as a function of the parameters.

    Rows near the borders of the drives and in their gaps stay out; they are determined
    once, so that the same rows are fitted for all offsets.
    """

    def __init__(
        self,
        drives: TimedMotion,
        ends: TimedMotion,
        features: DriveFeatures,
        start: ClockParameters,
        step: float,
    ):
        self._features = features
        self._middle = ends.span / 2
        rows = evenly_spread(len(ends.time), MAX_FITTED)
        thinned = TimedMotion(ends.time[rows], ends.values[rows])
        samples = self._samples(thinned.time, start)
        longest_gap = LONGEST_GAP * drives.interval
        inside = is_near(drives.time, samples, longest_gap)
        inside &= samples > step
        inside &= samples < drives.span - step
        self._time = thinned.time[inside]
        self._values = thinned.values[inside]
        scale = ClockParameters(
            offset=step, drift=step / ends.span, lag=step, width=WIDTH_SCALE
        )
        self._scale = np.array(scale)
        self._start = start

    @property
    def rows(self) -> int:
        """Number of fitted rows."""
        return len(self._time)

    def fit(self) -> ClockFit:
        """The best parameters near the start.

        The weights of outliers belong to the errors of a fit: at the start, all errors
        are large.
        """
        scaled = np.array(self._start) / self._scale
        for _ in range(PASSES):
            # weights of the rows: marker jumps would decide otherwise
            residuals = self._residuals(scaled, np.ones(self.rows))
            by_row = residuals.reshape(self.rows, -1)
            errors = np.linalg.norm(by_row, axis=1)
            limit = OUTLIER * np.median(errors) + 1e-12
            excess = np.maximum(1.0, errors / limit)
            weights = 1 / excess
            scaled = self._solve(scaled, weights)
        parameters = self._parameters(scaled)
        features = self._at(parameters)
        # share of the variance that is explained in stretches that are not fitted
        values = self._values
        stretches = np.arange(len(values)) * BLOCKS // len(values)
        odd = stretches % 2 == 1
        predicted = np.empty_like(values)
        for held_out in (odd, ~odd):
            fitted = weights * ~held_out
            slopes = _regress(features, values, fitted)
            predicted[held_out] = features[held_out] @ slopes
        mean = np.average(values, axis=0, weights=weights)
        error = _mean_square(values - predicted, weights)
        total = _mean_square(values - mean, weights)
        explained = 1 - error / total
        return ClockFit(
            parameters=parameters, explained=explained, problem=self, weights=weights
        )

    def deviations(self, fit: ClockFit) -> ClockParameters:
        """Standard deviations of the parameters of a fit.

        The delete-a-group jackknife omits each stretch of the log in turn: errors are
        correlated within a stretch. One Gauss-Newton step refits everything.
        """
        scaled = np.array(fit.parameters) / self._scale
        steps = []
        for stretch in np.array_split(np.arange(self.rows), BLOCKS):
            weights = fit.weights.copy()
            weights[stretch] = 0.0
            residuals = self._residuals(scaled, weights)
            jacobian = self._jacobian(scaled, weights)
            step, *_ = lstsq(jacobian, -residuals)
            steps.append(step)
        spread = np.std(steps, axis=0) * np.sqrt(BLOCKS - 1)
        return self._parameters(spread)

    def _solve(self, start: np.ndarray, weights: np.ndarray) -> np.ndarray:
        result = least_squares(
            self._residuals,
            start,
            self._jacobian,
            bounds=(LOWEST, HIGHEST),
            args=(weights,),
            max_nfev=MAX_EVALUATIONS,
            xtol=1e-5,
            ftol=1e-6,
        )
        return result.x

    def _samples(self, time: np.ndarray, parameters: ClockParameters) -> np.ndarray:
        """Times of the drives' clock."""
        drifted = parameters.drift * (time - self._middle)
        return time + parameters.offset + drifted

    def _parameters(self, scaled: np.ndarray) -> ClockParameters:
        values = scaled * self._scale
        return ClockParameters(*values.tolist())

    def _at(self, parameters: ClockParameters) -> np.ndarray:
        samples = self._samples(self._time, parameters)
        return self._features.at(samples, parameters.lag, parameters.width)

    def _residuals(self, scaled: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Weighted residuals of the regression on the features, in one row."""
        features = self._at(self._parameters(scaled))
        slopes = _regress(features, self._values, weights)
        errors = self._values - features @ slopes
        return (weights[:, None] * errors).ravel()

    def _jacobian(self, scaled: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return approx_fprime(scaled, self._residuals, DIFFERENCE, weights)


def _regress(
    features: np.ndarray, values: np.ndarray, weights: np.ndarray
) -> Float[np.ndarray, "features channels"]:
    """Weighted linear regression."""
    weighted = features * weights[:, None]
    matrix = weighted.T @ weighted
    ridge = RIDGE * np.trace(matrix) / len(matrix)
    matrix += ridge * np.eye(len(matrix))
    products = weighted.T @ (values * weights[:, None])
    return solve(matrix, products, assume_a="pos")


def _mean_square(errors: np.ndarray, weights: np.ndarray) -> float:
    weighted = errors * weights[:, None]
    return float(np.mean(weighted**2))
