"""Backlash, vibration modes and a delay, identified from inputs and outputs.

    y(t + T) = sum_i R_i x_i(t) + sum_j S_j v_j(t) + c + d t
    x_i'' + 2 z_i w_i x_i' + w_i^2 (x_i - p) = 0
    s_j v_j' + v_j = p,   p = play(u)

The delay T, the backlash of the inputs u, and frequency and damping ratio of every mode
are free; the time constants s_j are given. The phase of a mode saturates at 180 deg, that
of a delay grows with frequency without bound. The gains follow linearly (variable
projection). The fit to whole recordings (output-error method) tolerates noise; its last
round whitens the residuals by an autoregressive model of every output, so that it
minimizes the error of one-step predictions.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_toeplitz
from scipy.optimize import OptimizeResult, least_squares
from scipy.signal import lfilter

from s2c2a.arm.backlash import play_along

WHITENING_ORDER = 8
MAX_EVALUATIONS = 30  # of a fit

Grid = Float[np.ndarray, " grid"]


@dataclass(frozen=True, eq=False)
class Motion:
    """Inputs and outputs of a motion.

    Attributes:
        times: of the inputs [s], shape (n,).
        inputs: points of a path; each passes through its own backlash, shape (n,
            channels).
        weights: of the inputs, whose weighted sum moves the modes, shape (channels,).
        grid_period: of the simulated modes [s].
        output_times: evenly spaced [s], shape (frames,).
        outputs: shape (frames, outputs).
    """

    times: Float[np.ndarray, " n"]
    inputs: Float[np.ndarray, "n channels"]
    weights: Float[np.ndarray, " channels"]
    grid_period: float
    output_times: Float[np.ndarray, " frames"]
    outputs: Float[np.ndarray, "frames outputs"]


@dataclass(frozen=True, eq=False)
class SearchRanges:
    """Ranges and first values of the parameters.

    Parameters are: delay [s], half-width of the backlash, the frequencies [Hz] of the
    modes, and their damping ratios.

    Attributes:
        low: smallest delay, backlash, frequency and damping ratio, shape (4,).
        high: the largest ones, shape (4,).
        start: first parameters, shape (2 + 2 modes,).
        lags: time constants of the first-order terms [s].
    """

    low: Float[np.ndarray, " 4"]
    high: Float[np.ndarray, " 4"]
    start: Float[np.ndarray, " parameters"]
    lags: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class DelayedResponse:
    """Identified response.

    Attributes:
        delay: [s].
        delay_std: standard deviation of the delay, from noise [s].
        residuals: outputs that are not explained, shape (frames, outputs).
    """

    delay: float
    delay_std: float
    residuals: Float[np.ndarray, "frames outputs"]


def identify_response(motion: Motion, search: SearchRanges) -> DelayedResponse:
    """Fit the response to a motion."""
    grid = np.arange(motion.times[0], motion.times[-1], motion.grid_period)
    # finite differences of the other parameters use it again
    transmitted = lru_cache(maxsize=2)(partial(_transmitted, motion, grid))
    count = motion.outputs.shape[1]
    scale = motion.outputs.std(axis=0).max()
    first = _Fit(
        motion,
        search,
        grid,
        transmitted,
        [np.ones(1)] * count,
        np.full(count, scale),
    )
    low, high = _ranges(search)
    start = np.append(search.start[:2], np.log(search.start[2:]))
    best = first.solve(start.clip(low, high))
    whitened = first.whitened(best.x)
    result = whitened.solve(best.x)
    return whitened.response(result)


def _ranges(search: SearchRanges) -> Float[np.ndarray, "2 parameters"]:
    """Lowest and highest parameters; logarithms of frequencies and dampings."""
    modes = (len(search.start) - 2) // 2
    ranges = np.stack([search.low, search.high])
    ranges[:, 2:] = np.log(ranges[:, 2:])
    return np.repeat(ranges, [1, 1, modes, modes], axis=1)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A fit with given weights of the residuals.

    Attributes:
        motion: inputs and outputs.
        search: ranges of the parameters.
        grid: times of the simulation [s].
        transmitted: what a backlash transmits, on the grid.
        filters: that whiten the residuals of every output.
        noises: standard deviations of the whitened residuals.
    """

    motion: Motion
    search: SearchRanges
    grid: Grid
    transmitted: Callable[[float], Grid]
    filters: list[np.ndarray]
    noises: np.ndarray

    def solve(self, start: np.ndarray) -> OptimizeResult:
        low, high = _ranges(self.search)
        return least_squares(
            self._errors,
            start,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=MAX_EVALUATIONS,
        )

    def whitened(self, values: np.ndarray) -> "_Fit":
        """The fit with filters and weights by the residuals at parameters."""
        residuals = _projected(self._regressors(values), self.motion.outputs).T
        filters = [_whitening_filter(errors) for errors in residuals]
        pairs = zip(residuals, filters, strict=True)
        noises = [_filtered(errors, taps).std() for errors, taps in pairs]
        return replace(self, filters=filters, noises=np.array(noises))

    def response(self, result: OptimizeResult) -> DelayedResponse:
        outputs = self.motion.outputs
        regressors = self._regressors(result.x)
        gains = np.linalg.lstsq(regressors, outputs, rcond=None)[0]
        covariance = np.linalg.pinv(result.jac.T @ result.jac)
        return DelayedResponse(
            float(result.x[0]),
            float(np.sqrt(covariance[0, 0])),
            outputs - regressors @ gains,
        )

    def _errors(self, values: np.ndarray) -> np.ndarray:
        """Whitened residuals over their standard deviations."""
        regressors = self._regressors(values)
        weights = zip(self.motion.outputs.T, self.filters, self.noises, strict=True)
        errors = [
            _projected(_filtered(regressors, taps), _filtered(output, taps)) / noise
            for output, taps, noise in weights
        ]
        return np.concatenate(errors)

    def _regressors(self, values: np.ndarray) -> Float[np.ndarray, "frames terms"]:
        """Modes and the other terms at the times of the outputs."""
        period = self.motion.grid_period
        path = self.transmitted(float(values[1]))
        frequencies, dampings = np.exp(values[2:]).reshape(2, -1)
        terms = []
        for frequency, damping in zip(frequencies, dampings, strict=True):
            terms.append(second_order_response(path, period, frequency, damping))
        for lag in self.search.lags:
            terms.append(_first_order_response(path, period, lag))
        moments = self.motion.output_times - values[0]
        columns = [np.interp(moments, self.grid, term) for term in terms]
        columns += [np.ones_like(moments), moments - moments.mean()]
        return np.stack(columns, axis=1)


def _transmitted(motion: Motion, grid: Grid, backlash: float) -> Grid:
    """What backlash transmits, from zero on."""
    inputs = motion.inputs
    passed = play_along(inputs[0], inputs - backlash, inputs + backlash)
    path = (passed - passed[0]) @ motion.weights
    return np.interp(grid, motion.times, path)


def second_order_response(
    inputs: Grid, period: float, frequency: float, damping: float
) -> Grid:
    """Response of a vibration mode at rest, with a static gain of 1.

    Args:
        inputs: evenly spaced.
        period: of the inputs [s], short for the mode.
        frequency: without damping [Hz].
        damping: ratio.
    """
    # s = 2 / period (z - 1) / (z + 1), the bilinear transform, in closed form: that of
    # SciPy takes longer than the filter
    lag = 1.0 / (np.pi * frequency * period)
    loss = 2.0 * damping * lag
    square = lag**2
    middle = 2.0 - 2.0 * square
    denominator = [square + loss + 1.0, middle, square - loss + 1.0]
    return lfilter([1.0, 2.0, 1.0], denominator, inputs)


def _first_order_response(inputs: Grid, period: float, time_constant: float) -> Grid:
    """Response of 1 / (a s + 1), by the bilinear transform."""
    lag = 2.0 * time_constant / period
    return lfilter([1.0, 1.0], [lag + 1.0, 1.0 - lag], inputs)


def _filtered(values: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Values after a filter, without its beginning."""
    return lfilter(taps, 1.0, values, axis=0)[len(taps) :]


def _projected(regressors: np.ndarray, outputs: np.ndarray) -> np.ndarray:
    """What the best linear combination of regressors leaves of outputs."""
    basis, _ = np.linalg.qr(regressors)
    return outputs - basis @ (basis.T @ outputs)


def _whitening_filter(errors: np.ndarray) -> np.ndarray:
    """Taps that predict every error from those before (Yule-Walker)."""
    order = range(WHITENING_ORDER + 1)
    count = len(errors)
    products = [errors[: count - lag] @ errors[lag:] for lag in order]
    lags = np.array(products)
    lags[0] *= 1.0 + 1e-9
    return np.append(1.0, -solve_toeplitz(lags[:-1], lags[1:]))
