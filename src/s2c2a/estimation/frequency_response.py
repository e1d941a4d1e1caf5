"""Frequency response of the tip: first mode, gain, delay and backlash of a robot.

    y = g x(t) + r p(t) + c + d t
    x'' + 2 z w x' + w^2 (x - p) = 0
    p(t) = play(u)(t - T)

The play operator models backlash of the input u, and T is the delay. The first mode has
the angular frequency w and the damping ratio z; faster modes respond immediately, with
the gain r. The output-error method fits all parameters to the whole recording, so it
tolerates noise and missing readings. Inputs are constant within a control step.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter

from s2c2a.errors import S2C2AError

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
    low, high = _bounds(inputs, period, expected)

    def fit_weights(parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        components = _components(inputs, period, *parameters)[known]
        weights = np.linalg.lstsq(components, outputs[known], rcond=None)[0]
        return components @ weights - outputs[known], weights

    results = []
    for start in _starts(expected, low, high):
        result = least_squares(
            lambda parameters: fit_weights(parameters)[0],
            start,
            bounds=(low, high),
            x_scale=high - low,
        )
        results.append(result)
    best = min(results, key=lambda result: result.cost).x
    errors, weights = fit_weights(best)
    frequency, damping, delay, backlash = map(float, best)
    gain = float(weights[0] + weights[1])
    is_immediate = weights[1] > MAX_IMMEDIATE * gain
    if (expected * period > RESOLVED and is_immediate) or frequency * period > RESOLVED:
        frequency = damping = np.nan
    residual = float(np.sqrt(np.mean(errors**2)) / np.std(outputs[known]))
    return Response(frequency, damping, gain, delay, backlash, residual)


def _bounds(
    inputs: Series, period: float, expected: float
) -> tuple[np.ndarray, np.ndarray]:
    """Limits of frequency, damping ratio, delay and backlash."""
    max_frequency = min(MAX_FREQUENCY * expected, 0.5 / period)
    min_frequency = min(MIN_FREQUENCY * expected, max_frequency / 2.0)
    max_delay = max(MAX_DELAY_STEPS, MAX_DELAY_PERIODS / (expected * period))
    max_backlash = MAX_BACKLASH * np.abs(inputs).max()
    low = np.array([min_frequency, DAMPING_RATIOS[0], 0.0, 0.0])
    return low, np.array([max_frequency, DAMPING_RATIOS[1], max_delay, max_backlash])


def _starts(
    expected: float, low: np.ndarray, high: np.ndarray
) -> Float[np.ndarray, "starts 4"]:
    """Different starting points within the limits.

    For a mode that is fast for the control rate, many frequencies of `STARTS` are
    beyond the limit and become the same point.
    """
    frequency, delay, backlash = np.transpose(STARTS)
    damping = np.full_like(frequency, FIRST_DAMPING)
    delay = delay * high[2]
    backlash = backlash * high[3]
    starts = np.stack([frequency * expected, damping, delay, backlash], axis=1)
    return np.unique(starts.clip(low, high), axis=0)


def _components(
    inputs: Series,
    period: float,
    frequency: float,
    damping: float,
    delay: float,
    backlash: float,
) -> Float[np.ndarray, "steps 4"]:
    """Components of the output: first mode, immediate part, offset and drift."""
    transmitted = play_operator(inputs, backlash)
    mode = second_order_response(transmitted, period, frequency, damping, delay)
    offset = np.ones(len(inputs))
    drift = np.linspace(-1.0, 1.0, len(inputs))
    return np.stack([mode, _delayed(transmitted, delay), offset, drift], axis=1)


def play_operator(inputs: Series, half_width: float) -> Series:
    """Output of a play operator: it follows when the input leaves the backlash."""
    outputs = []
    output = float(inputs[0])
    for value in inputs.tolist():
        output = min(max(output, value - half_width), value + half_width)
        outputs.append(output)
    return np.array(outputs)


def second_order_response(
    inputs: Series, period: float, frequency: float, damping: float, delay: float
) -> Series:
    """Response of a second-order system at rest, exact at the control steps.

    With a fractional delay, the input of the step before acts in the first part of each
    step.
    """
    rate = 2.0 * np.pi * frequency
    whole = int(delay)
    share = delay % 1.0
    rates = np.array(
        [[0.0, 1.0, 0.0], [-(rate**2), -2.0 * damping * rate, rate**2], [0.0, 0.0, 0.0]]
    )
    durations = period * np.array([share, 1.0 - share])
    before, after = expm(np.multiply.outer(durations, rates))
    transition = after[:2, :2] @ before[:2, :2]
    denominator = [1.0, -np.trace(transition), np.linalg.det(transition)]
    outputs = np.full(len(inputs), inputs[0])
    changes = inputs - inputs[0]
    gains = (after[:2, 2], after[:2, :2] @ before[:2, 2])
    for steps, gain in zip((whole, whole + 1), gains, strict=True):
        second = (transition @ gain)[0] - np.trace(transition) * gain[0]
        numerator = [0.0, gain[0], second]
        outputs += lfilter(numerator, denominator, _shifted(changes, steps))
    return outputs


def _delayed(inputs: Series, delay: float) -> Series:
    """The input, late by a delay [control steps], interpolated between steps."""
    whole = int(delay)
    share = delay % 1.0
    earlier = _shifted(inputs, whole + 1)
    return (1.0 - share) * earlier + share * _shifted(inputs, whole + 2)


def _shifted(inputs: Series, steps: int) -> Series:
    return np.concatenate([np.full(steps, inputs[0]), inputs])[: len(inputs)]


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
