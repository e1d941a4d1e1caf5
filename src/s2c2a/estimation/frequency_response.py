"""How an arm answers: from tilts of its tip that were asked for, and seen, to its first mode, gain and delay.

    y = g x(t) + r p(t) + c + d t,    x'' + 2 z w x' + w^2 (x - p) = 0,    p(t) =
    play(u)(t - T)

Of what is asked, u, some is lost at every turn (play), and it comes late by T. The
first mode, with frequency w and damping ratio z, follows it; faster modes follow at
once (r). All of it is fitted to the whole recording (output error): noise and steps
without a reading do little harm, and what was held for a control step is taken as held.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import lfilter

from s2c2a.errors import S2C2AError

Series = Float[np.ndarray, " steps"]

# of the expected frequency; modes that are looked for
SLOWEST = 0.2
FASTEST = 4.0
RATIOS = 0.005, 1.5
LATEST = 6.0, 0.4  # control steps, or periods of the mode, whichever is more
MAX_LOST = 0.4  # of the largest tilt
STARTS = [
    (size, late, lost)
    for size in (0.5, 0.75, 1.1, 1.8)
    for late in (0.03, 0.3, 0.7)
    for lost in (0.01, 0.5)
]
"""Frequencies over the expected one, delays and losses over the most; fits from all of
them, for many end elsewhere."""
FIRST_RATIO = 0.3
# of the gain; where the mode should be fast, and so much follows at once, it is
MAX_AT_ONCE = 0.6
SEEN = 0.45  # of the control rate
FEWEST = 40  # readings
CLEAR = 0.03  # of the strongest part of what was asked; weaker frequencies tell nothing


class Response(NamedTuple):
    """How a tip answers.

    Attributes:
        frequency: of the first mode [Hz]; NaN where it is too fast for the control
            rate.
        damping: its damping ratio, the same; from 1 on nothing swings.
        gain: of slow motion, what comes over what is asked for beyond what is lost.
        delay: [control steps], the motors' lag included.
        lost: half of the motion that is lost at every turn [rad].
        left: part of the motion that was seen that this does not explain, root mean
            square.
    """

    frequency: float
    damping: float
    gain: float
    delay: float
    lost: float
    left: float


def response_of(
    asked: Series, seen: Series, period: float, expected: float
) -> Response:
    """Find it.

    Args:
        asked: tilts that were asked for [rad], each held for a control step from the
            moment of its reading on.
        seen: tilts at those moments [rad]; NaN where nothing was seen.
        period: of the control steps [s].
        expected: frequency of the first mode [Hz], about.

    Raises:
        S2C2AError: hardly anything was asked for, or seen.
    """
    known = np.isfinite(seen)
    if known.sum() < FEWEST or not np.ptp(asked) > 0.0 or not np.ptp(seen[known]) > 0.0:
        raise S2C2AError(
            f"no response in {known.sum()} readings; at least {FEWEST} of an arm that moves are needed"
        )
    low, high = _bounds(asked, period, expected)

    def fitted(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        parts = _parts(asked, period, *numbers)[known]
        weights = np.linalg.lstsq(parts, seen[known], rcond=None)[0]
        return parts @ weights - seen[known], weights

    starts = (
        np.array([size * expected, FIRST_RATIO, late * high[2], lost * high[3]])
        for size, late, lost in STARTS
    )
    found = [
        least_squares(
            lambda numbers: fitted(numbers)[0],
            start.clip(low, high),
            bounds=(low, high),
            x_scale=high - low,
        )
        for start in starts
    ]
    best = min(found, key=lambda one: one.cost).x
    missed, weights = fitted(best)
    frequency, damping, delay, lost = map(float, best)
    left = float(np.sqrt(np.mean(missed**2)) / np.std(seen[known]))
    gain = float(weights[0] + weights[1])
    at_once = expected * period > SEEN and weights[1] > MAX_AT_ONCE * gain
    if at_once or frequency * period > SEEN:
        frequency = damping = np.nan
    return Response(frequency, damping, gain, delay, lost, left)


def _bounds(
    asked: Series, period: float, expected: float
) -> tuple[np.ndarray, np.ndarray]:
    """Of frequency, damping ratio, delay and what is lost."""
    fastest = min(FASTEST * expected, 0.5 / period)
    latest = max(LATEST[0], LATEST[1] / (expected * period))
    low = [min(SLOWEST * expected, fastest / 2.0), RATIOS[0], 0.0, 0.0]
    return np.array(low), np.array(
        [fastest, RATIOS[1], latest, MAX_LOST * np.abs(asked).max()]
    )


def _parts(
    asked: Series,
    period: float,
    frequency: float,
    damping: float,
    delay: float,
    lost: float,
) -> Float[np.ndarray, "steps 4"]:
    """What is seen is a sum of these, by weights: what swings, what follows at once, what stands, what drifts."""
    came = play(asked, lost)
    swung = swing(came, period, frequency, damping, delay)
    return np.stack(
        [
            swung,
            _late(came, delay),
            np.ones(len(came)),
            np.linspace(-1.0, 1.0, len(came)),
        ],
        axis=1,
    )


def play(asked: Series, lost: float) -> Series:
    """What comes of a motion of which so much is lost to either side [rad]."""
    came = []
    now = float(asked[0])
    for desired in asked.tolist():
        now = min(max(now, desired - lost), desired + lost)
        came.append(now)
    return np.array(came)


def swing(
    held: Series, period: float, frequency: float, damping: float, delay: float
) -> Series:
    """What follows as a mode does, from rest: exact at control steps for what is held in between, `delay` steps late.

    Within a step, what was held before acts for the part of it by which the delay is no
    whole number of steps.
    """
    rate = 2.0 * np.pi * frequency
    whole = int(delay)
    share = delay % 1.0
    rates = np.array(
        [[0.0, 1.0, 0.0], [-(rate**2), -2.0 * damping * rate, rate**2], [0.0, 0.0, 0.0]]
    )
    before, after = expm(
        np.multiply.outer(period * np.array([share, 1.0 - share]), rates)
    )
    steps = after[:2, :2] @ before[:2, :2]
    trace = np.trace(steps)
    size = np.linalg.det(steps)
    swung = np.full(len(held), held[0])
    for late, moved in (
        (whole, after[:2, 2]),
        (whole + 1, after[:2, :2] @ before[:2, 2]),
    ):
        heads = [0.0, moved[0], (steps @ moved)[0] - trace * moved[0]]
        swung += lfilter(heads, [1.0, -trace, size], _shifted(held - held[0], late))
    return swung


def _late(held: Series, delay: float) -> Series:
    """What is held, so many steps late; between steps as if motors took a step to get there."""
    whole = int(delay)
    share = delay % 1.0
    return (1.0 - share) * _shifted(held, whole + 1) + share * _shifted(held, whole + 2)


def _shifted(held: Series, steps: int) -> Series:
    return np.concatenate([np.full(steps, held[0]), held])[: len(held)]


def spectrum(
    asked: Series, seen: Series, period: float, bands: int = 16
) -> tuple[Float[np.ndarray, " bands"], Complex[np.ndarray, " bands"]]:
    """What comes over what is asked, by frequency, without any model: from cross spectra, band by band.

    Args:
        asked: tilts [rad].
        seen: the same [rad]; NaN where nothing was seen.
        period: of the control steps [s].
        bands: of frequencies, as wide as each other on a logarithmic scale.

    Returns:
        Frequencies [Hz], and gains with their phases; of bands in which something was
        asked.
    """
    places = np.arange(len(seen))
    known = np.isfinite(seen)
    whole = np.interp(places, places[known], seen[known])
    desired, came = (np.fft.rfft(part - part.mean()) for part in (asked, whole))
    frequencies = np.fft.rfftfreq(len(asked), period)
    power = np.abs(desired) ** 2
    strong = np.flatnonzero(power > CLEAR * power.max())
    edges = np.geomspace(
        frequencies[strong[0]], frequencies[strong[-1]] * 1.001, bands + 1
    )
    band = np.where(
        np.isin(np.arange(len(power)), strong), np.digitize(frequencies, edges), 0
    )
    chosen = [np.flatnonzero(band == number) for number in range(1, bands + 1)]
    chosen = [one for one in chosen if len(one)]
    middles = [np.average(frequencies[one], weights=power[one]) for one in chosen]
    gains = [
        np.sum(came[one] * desired[one].conj()) / np.sum(power[one]) for one in chosen
    ]
    return np.array(middles), np.array(gains)
