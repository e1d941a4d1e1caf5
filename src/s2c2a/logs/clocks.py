r"""Offset and drift between the clocks of drives and ends, estimated from their motion.

The correlation of speeds gives candidates. Least squares refines each: the ends are a
smooth function of the drives and their backlash, filtered by a first-order lag,

$$ y(t) = W \, \phi(x_\tau(s)), \qquad s = t + o + d (t - t_m), $$

with offset o, drift d and lag tau; W is eliminated (variable projection). A pure delay
between drives and ends cannot be distinguished from the offset and is part of it.
"""

from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.signal import correlate, lfilter

from s2c2a.logs.errors import LogError
from s2c2a.logs.interpolation import is_near

MAX_GRID = 2**16  # points of a grid in time; bounds time and memory
MAX_FITTED = 3000  # rows of the ends that are fitted, evenly spread
MIN_ROWS = 60
"""Rows with known drives and ends; fewer hardly hold the blocks of the deviation."""
DRIFTS = 500e-6 * np.linspace(-1, 1, 21)
"""Drifts of the first search; clocks of computers and cameras are within 100 ppm."""
CANDIDATES = 4  # peaks of the correlation that are refined
LONGEST_GAP = 4.0  # rows of the ends in longer gaps of the drives are not fitted, rows
BLOCKS = 20  # stretches of the log whose scatter gives the deviation
WIDTHS = tuple(0.01 * step for step in range(21))
"""Half widths of the backlash, relative to a drive's travel; between them, linear."""
LEAST_MOTION = 0.03  # size of a component of the drives, relative to the largest one
MIN_EXPLAINED = 0.5
"""Share of the ends' variance that the drives must explain: more than is left."""
AMBIGUOUS = 0.8
"""Ratio of squared residuals above which two offsets explain the motion equally well,
as for repeated motions."""
ADVICE = "state join.offset, or record a longer, irregular motion"


class LogClock(NamedTuple):
    """Conversion of the times of a later file to the clock of the first one.

    Attributes:
        offset: first clock minus later clock [s], at `middle`.
        drift: seconds that the first clock gains per second of the later one.
        middle: time of the later clock [s] to which the offset belongs.
        offset_std: standard deviation of the offset [s]; 0 if stated.
        drift_std: standard deviation of the drift; 0 if stated.
        explained: share of the ends' variance that the drives explain in stretches that
            are not fitted; NaN if stated.
        lag: time constant with which the ends follow the drives [s]; NaN if stated.
    """

    offset: float
    drift: float = 0.0
    middle: float = 0.0
    offset_std: float = 0.0
    drift_std: float = 0.0
    explained: float = float("nan")
    lag: float = float("nan")

    def convert(self, times: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " rows"]:
        """Times of the first clock [s], from those of the later one."""
        return times + self.offset + self.drift * (times - self.middle)

    def inverted(self) -> "LogClock":
        """Conversion from the first clock to the later one."""
        return self._replace(
            offset=-self.offset,
            drift=-self.drift / (1 + self.drift),
            middle=self.middle + self.offset,
        )

    def summary(self) -> dict[str, float | str]:
        """Numbers by name, for the options of a recording."""
        if not np.isfinite(self.explained):
            return {"origin": "stated", "offset": self.offset}
        values = self._asdict()
        return {"origin": "estimated"} | {
            name: float(value) for name, value in values.items()
        }

    def __str__(self) -> str:
        """One sentence."""
        if not np.isfinite(self.explained):
            return f"{self.offset:+.6g} s (stated) give the time of the first file"
        return (
            f"{self.offset:+.4f} s +- {1e3 * self.offset_std:.1f} ms give the time of "
            f"the first file; its drift is {1e6 * self.drift:.0f} +- "
            f"{1e6 * self.drift_std:.0f} ppm; estimated from the motion, of which the "
            f"drives explain {100 * self.explained:.0f} %"
        )


class TimedMotion(NamedTuple):
    """Values of drives or ends by their own clock.

    Attributes:
        time: increasing times [s].
        values: finite values in any unit.
    """

    time: Float[np.ndarray, " rows"]
    values: Float[np.ndarray, "rows channels"]

    @property
    def interval(self) -> float:
        """Median interval of the rows [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def span(self) -> float:
        """Time from the first row to the last one [s]."""
        return float(self.time[-1] - self.time[0])


class _ClockFit(NamedTuple):
    """Offset at the middle [s], drift, lag [s], and backlash; results of the fit."""

    parameters: Float[np.ndarray, "4"]
    residuals: np.ndarray | None = None
    jacobian: np.ndarray | None = None
    explained: float = 0.0


def estimate_clock(drives: TimedMotion, ends: TimedMotion) -> LogClock:
    """Conversion of times of the ends to the clock of the drives.

    Raises:
        LogError: there are too few rows, or the motion does not determine the offset.
    """
    for name, motion in (("drives", drives), ("ends", ends)):
        _check_motion(name, motion)
    # times since the first row: a clock since 1970 leaves few digits
    begins = drives.time[0], ends.time[0]
    drives = TimedMotion(drives.time - begins[0], _standardize(drives.values))
    ends = TimedMotion(ends.time - begins[1], _standardize(ends.values))
    step = max(
        2 * max(drives.interval, ends.interval),
        max(drives.span, ends.span) / MAX_GRID,
    )
    fits = [_refine(drives, ends, each, step) for each in _search(drives, ends, step)]
    best = _unambiguous(fits, step)
    clock = _with_deviation(best, ends.span / 2)
    if not clock.offset_std < drives.interval + ends.interval:
        raise LogError(
            f"the motion determines the offset between the clocks only within "
            f"{clock.offset_std:.2g} s; {ADVICE}"
        )
    return clock._replace(
        offset=clock.offset + begins[0] - begins[1], middle=clock.middle + begins[1]
    )


def _check_motion(name: str, motion: TimedMotion) -> None:
    if len(motion.time) < MIN_ROWS:
        raise LogError(
            f"{len(motion.time)} rows with time and values of all {name}; at least "
            f"{MIN_ROWS} are needed to estimate the offset between the clocks; {ADVICE}"
        )
    if not (np.ptp(motion.values, axis=0) > 0).any():
        raise LogError(
            f"the {name} do not move, so the offset between the clocks is unknown; "
            f"{ADVICE}"
        )


def _standardize(values: np.ndarray) -> np.ndarray:
    """Channels that move, with unit scale by their quantiles: robust to outliers."""
    low, high = np.quantile(values, [0.05, 0.95], axis=0)
    moves = high > low
    if not moves.any():
        low, high = values.min(axis=0), values.max(axis=0)
        moves = high > low
    return (values[:, moves] - low[moves]) / (high - low)[moves]


def _search(drives: TimedMotion, ends: TimedMotion, step: float) -> list[_ClockFit]:
    """Highest peaks of the correlation of speeds, over offsets and drifts."""
    peaks = []
    drive_speeds = _speeds(drives, step)
    middle = ends.span / 2
    is_short = ends.span * DRIFTS[-1] < step
    for drift in (0.0,) if is_short else DRIFTS:
        time = ends.time + drift * (ends.time - middle)
        start = time[0]
        correlation = _correlation(
            drive_speeds, _speeds(TimedMotion(time - start, ends.values), step)
        )
        lags, values = correlation
        for index in np.argsort(values)[::-1][: 8 * CANDIDATES]:
            offset = lags[index] * step - start
            peaks.append((values[index], offset, drift))
    chosen: list[_ClockFit] = []
    for _, offset, drift in sorted(peaks, reverse=True):
        others = [abs(each.parameters[0] - offset) for each in chosen]
        if min(others, default=np.inf) > 3 * step:
            chosen.append(_ClockFit(np.array([offset, drift, step / 4, 0.02])))
    return chosen[:CANDIDATES]


def _speeds(motion: TimedMotion, step: float) -> np.ndarray:
    """Speeds on a grid, from means of its cells; NaN where a cell is empty."""
    cells = np.floor(motion.time / step).astype(int)
    count = np.bincount(cells)
    sums = [np.bincount(cells, channel) for channel in motion.values.T]
    with np.errstate(invalid="ignore"):
        means = np.stack(sums, axis=1) / count[:, None]
    # the root weighs slow motion like fast motion
    return np.sqrt(np.linalg.norm(np.diff(means, axis=0), axis=1))


def _correlation(first: np.ndarray, later: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlation of two signals with gaps where at least half of one overlaps.

    Returns:
        Lags of the second signal in the first one, and correlations.
    """
    known, other_known = np.isfinite(first), np.isfinite(later)
    signal, other = np.nan_to_num(first), np.nan_to_num(later)

    def sums(one: np.ndarray, two: np.ndarray) -> np.ndarray:
        return correlate(one.astype(float), two.astype(float), method="fft")

    count = np.round(sums(known, other_known))
    mean = sums(signal, other_known)
    other_mean = sums(known, other)
    products = count * sums(signal, other) - mean * other_mean
    variance = count * sums(signal**2, other_known) - mean**2
    other_variance = count * sums(known, other**2) - other_mean**2
    scale = np.sqrt(np.maximum(variance * other_variance, 0.0))
    enough = count >= max(0.5 * min(known.sum(), other_known.sum()), 4)
    valid = enough & (scale > 1e-9 * scale.max())
    values = np.divide(products, scale, out=np.full(len(count), -1.0), where=valid)
    return np.arange(len(count)) - (len(later) - 1), values


def _refine(
    drives: TimedMotion, ends: TimedMotion, start: _ClockFit, step: float
) -> _ClockFit:
    """Least squares of offset, drift, and lag, from a candidate."""
    middle = ends.span / 2
    rows = np.linspace(0, len(ends.time) - 1, min(len(ends.time), MAX_FITTED))
    time = ends.time[rows.astype(int)]
    values = ends.values[rows.astype(int)]
    samples = time + start.parameters[0] + start.parameters[1] * (time - middle)
    # rows at the borders stay out, so that the same rows are fitted for all offsets
    inside = (samples > step) & (samples < drives.span - step)
    inside &= is_near(drives.time, samples, LONGEST_GAP * drives.interval)
    time, values = time[inside], values[inside]
    if len(time) < MIN_ROWS:
        return start
    features = _Features(drives, len(time))
    scale = np.array([step, step / ends.span, step, 0.2])
    weights = np.ones(len(time))

    def residuals(scaled: np.ndarray) -> np.ndarray:
        offset, drift, lag, width = scaled * scale
        samples = time + offset + drift * (time - middle)
        return _project(features.at(samples, lag, width), values, weights).ravel()

    first = start.parameters / scale
    errors = np.linalg.norm(residuals(first).reshape(values.shape), axis=1)
    # marker jumps would decide; the limit is three times a usual error
    weights = 1 / np.maximum(1.0, errors / (3 * np.median(errors) + 1e-12))
    jacobian = _differences(residuals)
    bounds = ([-np.inf, -np.inf, 0.0, 0.0], [np.inf, np.inf, np.inf, 1.0])
    result = least_squares(
        residuals, first, jacobian, bounds=bounds, max_nfev=20, xtol=1e-5, ftol=1e-6
    )
    offset, drift, lag, width = result.x * scale
    samples = time + offset + drift * (time - middle)
    explained = _held_out(features.at(samples, lag, width), values, weights)
    return _ClockFit(
        result.x * scale,
        result.fun.reshape(values.shape),
        (result.jac / scale).reshape(*values.shape, 4),
        explained,
    )


def _differences(
    function: Callable[[np.ndarray], np.ndarray], width: float = 0.02
) -> Callable[[np.ndarray], np.ndarray]:
    """Jacobian by differences wide enough for interpolated data.

    The width is relative to the scaled parameters, whose unit is about two rows.
    """

    def jacobian(vector: np.ndarray) -> np.ndarray:
        first = function(vector)
        rises = [
            function(vector + step) - first for step in width * np.eye(len(vector))
        ]
        return np.stack(rises, axis=1) / width

    return jacobian


def _held_out(features: np.ndarray, values: np.ndarray, weights: np.ndarray) -> float:
    """Share of the variance that is explained in stretches that are not fitted.

    Motion is smooth, so that features explain half of a foreign log that is fitted.
    """
    half = np.arange(len(values)) * BLOCKS // len(values) % 2 == 1
    errors = 0.0
    total = 0.0
    for held_out in (half, ~half):
        fitted = weights * ~held_out
        slopes = _regress(features, values, fitted)
        mean = np.average(values, axis=0, weights=fitted)
        kept = (weights * held_out)[:, None]
        errors += np.sum((kept * (values - features @ slopes)) ** 2)
        total += np.sum((kept * (values - mean)) ** 2)
    return float(1 - errors / total)


def _regress(
    features: np.ndarray, values: np.ndarray, weights: np.ndarray
) -> Float[np.ndarray, "features channels"]:
    """Weighted linear regression."""
    features = features * weights[:, None]
    values = values * weights[:, None]
    matrix = features.T @ features
    # a small ridge: features of antagonistic drives are nearly equal
    matrix += 1e-8 * np.trace(matrix) / len(matrix) * np.eye(len(matrix))
    return np.linalg.solve(matrix, features.T @ values)


def _project(
    features: np.ndarray, values: np.ndarray, weights: np.ndarray
) -> Float[np.ndarray, "rows channels"]:
    """Weighted residuals of the linear regression on the features."""
    slopes = _regress(features, values, weights)
    return weights[:, None] * (values - features @ slopes)


class _Features:
    """Polynomials of the drives after backlash and a lag, which have a grid in time."""

    def __init__(self, drives: TimedMotion, rows: int):
        interval = max(drives.interval / 4, drives.span / MAX_GRID)
        grid = interval * np.arange(int(drives.span / interval) + 2)
        # straight lines between few rows would damp fast motion as a lag does
        values = CubicSpline(drives.time, drives.values)(grid)
        # a spline swings far out in a gap
        values = values.clip(drives.values.min(axis=0), drives.values.max(axis=0))
        self._interval = interval
        self._values = [_backlash(values, width) for width in WIDTHS]
        self._powers = _powers(values, rows)

    def at(self, times: np.ndarray, lag: float, width: float) -> np.ndarray:
        """Polynomials at some times, after a first-order lag [s] and backlash."""
        filtered = self._filter(lag, width)
        position = np.clip(times / self._interval, 0, len(filtered) - 1.001)
        index = position.astype(int)
        share = (position - index)[:, None]
        return self._powers((1 - share) * filtered[index] + share * filtered[index + 1])

    def _with_backlash(self, width: float) -> np.ndarray:
        """Drives after backlash, between the two nearest widths."""
        position = np.clip(np.interp(width, WIDTHS, range(len(WIDTHS))), 0, None)
        index = min(int(position), len(WIDTHS) - 2)
        share = position - index
        return (1 - share) * self._values[index] + share * self._values[index + 1]

    def _filter(self, lag: float, width: float) -> np.ndarray:
        """First-order lag, exact for values that are linear between grid points."""
        values = self._with_backlash(width)
        ratio = lag / self._interval
        decay = np.exp(-1 / ratio) if ratio > 1e-3 else 0.0
        rise = 1 - (1 - decay) * ratio
        coefficients = [rise, 1 - decay - rise]
        # the state of a filter that has rested at the first value
        state = (1 - rise) * values[:1]
        return lfilter(coefficients, [1, -decay], values, axis=0, zi=state)[0]


def _powers(values: np.ndarray, rows: int) -> Callable[[np.ndarray], np.ndarray]:
    """Products of principal components up to the third degree, if the rows suffice."""
    mean = values.mean(axis=0)
    thinned = values[:: max(len(values) // MAX_FITTED, 1)] - mean
    _, sizes, directions = np.linalg.svd(thinned, full_matrices=False)
    is_moving = sizes > LEAST_MOTION * sizes[0]
    scaled = directions[is_moving].T / sizes[is_moving] * np.sqrt(len(thinned))
    chosen: list[tuple[int, ...]] = [()]
    for degree in (1, 2, 3):
        more = combinations_with_replacement(range(scaled.shape[1]), degree)
        products = list(more)
        # more features than a tenth of the rows would fit the noise
        if degree > 1 and len(chosen) + len(products) > rows / 10:
            break
        chosen += products

    def powers(values: np.ndarray) -> np.ndarray:
        components = (values - mean) @ scaled
        columns = [np.prod(components[:, list(each)], axis=1) for each in chosen]
        return np.stack(columns, axis=1)

    return powers


def _backlash(values: np.ndarray, width: float) -> np.ndarray:
    """Play operator of each drive."""
    played = np.empty_like(values)
    state = values[0]
    for row, value in enumerate(values):
        state = np.minimum(np.maximum(state, value - width), value + width)
        played[row] = state
    return played


def _unambiguous(fits: list[_ClockFit], step: float) -> _ClockFit:
    """Best fit; it must explain the motion, and clearly better than other offsets."""
    best = max(fits, key=lambda fit: fit.explained)
    explained = best.explained
    if not explained > MIN_EXPLAINED:
        raise LogError(
            f"at no offset between the clocks do the drives explain more than "
            f"{100 * max(explained, 0.0):.0f} % of the motion of the ends "
            f"({100 * MIN_EXPLAINED:.0f} % are needed); check that the files belong "
            f"together, or {ADVICE}"
        )
    for other in fits:
        apart = other.parameters[0] - best.parameters[0]
        ratio = (1 - explained) / (1 - other.explained)
        if abs(apart) > 2 * step and ratio > AMBIGUOUS:
            raise LogError(
                f"offsets between the clocks that differ by {abs(apart):.3g} s explain "
                f"the motion about equally well, since it repeats itself; {ADVICE}"
            )
    return best


def _with_deviation(fit: _ClockFit, middle: float) -> LogClock:
    """LogClock with deviations from the scatter of stretches; errors are correlated."""
    assert fit.residuals is not None
    assert fit.jacobian is not None
    rows = len(fit.residuals)
    jacobian = fit.jacobian.reshape(-1, 4)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14, hermitian=True)
    gradients = np.zeros((BLOCKS, 4))
    products = np.einsum("rci,rc->ri", fit.jacobian, fit.residuals)
    np.add.at(gradients, np.arange(rows) * BLOCKS // rows, products)
    scatter = inverse @ (gradients.T @ gradients) @ inverse * BLOCKS / (BLOCKS - 1)
    offset_std, drift_std, *_ = np.sqrt(np.diag(scatter))
    offset, drift, lag, _ = fit.parameters
    return LogClock(
        float(offset),
        float(drift),
        middle,
        float(offset_std),
        float(drift_std),
        fit.explained,
        float(lag),
    )
