"""Frequency response of the tip: first mode, gain, delay and backlash of a robot.

The first mode vibrates, and faster modes follow at once (`delayed_response`). Inputs
are constant within a control step, and readings may be missing.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from s2c2a.errors import S2C2AError
from s2c2a.lab.response.delayed_response import Motion, SearchRanges, identify_response

Series = Float[np.ndarray, " steps"]

# search range of the first mode, in parts of the expected frequency
MIN_FREQUENCY = 0.2
MAX_FREQUENCY = 4.0
DAMPING_RATIOS = (0.005, 1.5)
MAX_DELAY_STEPS = 6.0
MAX_DELAY_PERIODS = 0.4  # of the mode; the larger limit holds
MAX_BACKLASH = 0.4  # of the largest tilt
FIRST_DAMPING = 0.3
STARTS = [
    (frequency, delay, backlash)
    for frequency in (0.5, 0.75, 1.1, 1.8)
    for delay in (0.03, 0.3, 0.7)
    for backlash in (0.01, 0.5)
]
"""Starting points, since many fits end in a local minimum.

Frequency over the expected one, delay and backlash over their limits.
"""
MAX_IMMEDIATE = 0.6  # of the gain; above it, a fast mode cannot be resolved
RESOLVED = 0.45  # of the control rate
GRID_STEPS = 10  # of a simulated mode, in a control period
MIN_READINGS = 40
MIN_POWER = 0.03  # of the strongest frequency of the input


class Response(NamedTuple):
    """Frequency response of a tip.

    Attributes:
        frequency: frequency of the first mode [Hz]; NaN if it is too fast for the
            control rate.
        damping: damping ratio of the first mode; from 1 on it does not vibrate.
        gain: static gain beyond the backlash.
        delay: delay including the lag of the motors [control steps].
        backlash: half-width of the backlash [rad].
        residual: root mean square of the residual, over that of the motion.
    """

    frequency: float
    damping: float
    gain: float
    delay: float
    backlash: float
    residual: float


def fit_response(
    inputs: Series, outputs: Series, period: float, expected: float
) -> Response:
    """Fit the response to a recording.

    Args:
        inputs: commanded tilts [rad], each constant for a control step.
        outputs: measured tilts [rad] at the beginning of each step; NaN if missing.
        period: control period [s].
        expected: approximate frequency of the first mode [Hz].

    Raises:
        S2C2AError: there are too few readings, or there is no motion.
    """
    known = np.isfinite(outputs)
    moves = np.ptp(inputs) > 0.0 and known.any() and np.ptp(outputs[known]) > 0.0
    if known.sum() < MIN_READINGS or not moves:
        raise S2C2AError(
            f"no response in {known.sum()} readings; record at least {MIN_READINGS} of "
            "an arm that moves"
        )
    grid_period = period / GRID_STEPS
    times = np.arange(len(inputs)) * period
    # each command is held, and the next one begins in the middle of a grid step
    held = np.array([0.5 * grid_period, period - 0.5 * grid_period])
    motion = Motion(
        np.add.outer(times, held).ravel(),
        np.repeat(inputs, 2)[:, None],
        np.ones(1),
        grid_period,
        times[known],
        outputs[known, None],
    )
    found = identify_response(motion, _search(inputs, period, expected))
    by_mode, by_fast_modes = found.gains[:, 0]
    gain = float(by_mode + by_fast_modes)
    frequency = float(found.frequencies[0])
    damping = float(found.dampings[0])
    is_immediate = by_fast_modes > MAX_IMMEDIATE * gain
    if (expected * period > RESOLVED and is_immediate) or frequency * period > RESOLVED:
        frequency = damping = np.nan
    residual = np.sqrt(np.mean(found.residuals**2)) / np.std(outputs[known])
    delay = found.delay / period
    return Response(frequency, damping, gain, delay, found.backlash, float(residual))


def _search(inputs: Series, period: float, expected: float) -> SearchRanges:
    """Ranges and starting points around an expected frequency.

    For a mode that is fast for the control rate, many frequencies of `STARTS` are
    beyond the limit and become the same point.
    """
    max_frequency = min(MAX_FREQUENCY * expected, 0.5 / period)
    min_frequency = min(MIN_FREQUENCY * expected, max_frequency / 2.0)
    max_delay = max(MAX_DELAY_STEPS * period, MAX_DELAY_PERIODS / expected)
    max_backlash = MAX_BACKLASH * np.abs(inputs).max()
    low = np.array([0.0, 0.0, min_frequency, DAMPING_RATIOS[0]])
    high = np.array([max_delay, max_backlash, max_frequency, DAMPING_RATIOS[1]])
    frequency, delay, backlash = np.transpose(STARTS)
    damping = np.full_like(frequency, FIRST_DAMPING)
    starts = [delay * max_delay, backlash * max_backlash, frequency * expected, damping]
    return SearchRanges(low, high, np.stack(starts, axis=1), averaged=period)


def spectrum(
    inputs: Series, outputs: Series, period: float, bands: int = 16
) -> tuple[Float[np.ndarray, " bands"], Complex[np.ndarray, " bands"]]:
    """Complex gain over frequency, from cross spectra, without a model.

    Args:
        inputs: tilts [rad].
        outputs: tilts [rad]; NaN if missing.
        period: control period [s].
        bands: number of frequency bands, of equal width on a logarithmic scale.

    Returns:
        Frequencies [Hz] and gains of the bands in which the input has power.
    """
    steps = np.arange(len(outputs))
    known = np.isfinite(outputs)
    complete = np.interp(steps, steps[known], outputs[known])
    input_fft = np.fft.rfft(inputs - inputs.mean())
    output_fft = np.fft.rfft(complete - complete.mean())
    frequencies = np.fft.rfftfreq(len(inputs), period)
    power = np.abs(input_fft) ** 2
    strong = np.flatnonzero(power > MIN_POWER * power.max())
    last = frequencies[strong[-1]] * 1.001
    edges = np.geomspace(frequencies[strong[0]], last, bands + 1)
    band = np.digitize(frequencies[strong], edges)
    centers = []
    gains = []
    for number in np.unique(band):
        chosen = strong[band == number]
        cross = np.sum(output_fft[chosen] * input_fft[chosen].conj())
        centers.append(np.average(frequencies[chosen], weights=power[chosen]))
        gains.append(cross / np.sum(power[chosen]))
    return np.array(centers), np.array(gains)
