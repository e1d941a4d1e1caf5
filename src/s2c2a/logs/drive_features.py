"""Features of drives that explain where the ends are: polynomials after backlash, lag."""

from itertools import combinations_with_replacement
from math import comb

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline, make_interp_spline
from scipy.signal import cont2discrete, lfilter, lfilter_zi

from s2c2a.arm.backlash import play_along
from s2c2a.logs.timed_motion import TimedMotion

MAX_GRID = 2**16  # points of a grid in time; bounds time and memory
MAX_FITTED = 3000  # rows that are fitted, evenly spread
WIDTHS = np.linspace(0.0, 0.2, 21)
"""Half widths of the backlash, relative to a drive's travel; between them, linear."""
LEAST_LAG = 1e-3  # of the filter, in intervals of the grid
LEAST_MOTION = 0.03  # size of a component of the drives, relative to the largest one
MAX_DEGREE = 3
ROWS_PER_FEATURE = 10  # more features would fit the noise


class DriveFeatures:
    """Polynomials of the drives after backlash and a first-order lag."""

    def __init__(self, drives: TimedMotion, rows: int):
        self._interval = max(drives.interval / 4, drives.span / MAX_GRID)
        points = int(drives.span / self._interval) + 2
        self._grid = self._interval * np.arange(points)
        # straight lines between few rows would damp fast motion as a lag does
        values = CubicSpline(drives.time, drives.values)(self._grid)
        lowest = drives.values.min(axis=0)
        highest = drives.values.max(axis=0)
        # a spline swings far out in a gap
        values = values.clip(lowest, highest)
        # (widths, points, channels)
        played = [
            play_along(values[0], values - width, values + width) for width in WIDTHS
        ]
        self._played = make_interp_spline(WIDTHS, played, k=1)
        self._polynomials = _Polynomials(values, rows)

    def at(
        self, times: Float[np.ndarray, " rows"], lag: float, width: float
    ) -> Float[np.ndarray, "rows features"]:
        """Features at some times, after a lag [s] and backlash."""
        played = self._played(width)
        lag = max(lag, LEAST_LAG * self._interval)
        # first-order lag, exact for values that are linear between grid points
        system = ([1.0], [lag, 1.0])
        numerator, denominator, _ = cont2discrete(system, self._interval, "foh")
        numerator = numerator.ravel()
        # the filter has rested at the first value
        state = lfilter_zi(numerator, denominator)[:, None] * played[:1]
        filtered, _ = lfilter(numerator, denominator, played, axis=0, zi=state)
        spline = make_interp_spline(self._grid, filtered, k=1)
        inside = times.clip(0, self._grid[-1])
        values = spline(inside)
        return self._polynomials.at(values)


class _Polynomials:
    """Products of principal components up to the third degree, if the rows suffice."""

    def __init__(self, values: np.ndarray, rows: int):
        self._mean = values.mean(axis=0)
        stride = max(len(values) // MAX_FITTED, 1)
        thinned = values[::stride] - self._mean
        decomposition = np.linalg.svd(thinned, full_matrices=False)
        sizes = decomposition.S
        directions = decomposition.Vh
        moving = sizes > LEAST_MOTION * sizes[0]
        deviations = sizes[moving] / np.sqrt(len(thinned))
        self._directions = directions[moving].T / deviations
        components = int(moving.sum())
        # highest degree for which the rows suffice
        degree = 1
        for higher in range(2, MAX_DEGREE + 1):
            features = comb(components + higher, higher)
            if features * ROWS_PER_FEATURE <= rows:
                degree = higher
        # factor 0 is 1, so that products of fewer components occur, too
        factors = range(components + 1)
        products = combinations_with_replacement(factors, degree)
        self._products = np.array(list(products))

    def at(self, values: np.ndarray) -> np.ndarray:
        """Values of all polynomials, of shape (rows, features)."""
        components = (values - self._mean) @ self._directions
        ones = np.ones((len(values), 1))
        factors = np.hstack([ones, components])
        return factors[:, self._products].prod(axis=2)
