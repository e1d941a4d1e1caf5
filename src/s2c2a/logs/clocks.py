"""Offset and drift between the clocks of drives and ends, estimated from their motion.

The correlation of speeds gives candidates (`clock_search`), which least squares refines
(`clock_fit`). A pure delay between drives and ends cannot be distinguished from the
offset and is part of it.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from s2c2a.errors import counted
from s2c2a.logs.clock_fit import MIN_ROWS, ClockParameters, ClockProblem
from s2c2a.logs.clock_search import search_clocks
from s2c2a.logs.drive_features import MAX_FITTED, MAX_GRID, DriveFeatures
from s2c2a.logs.errors import LogError
from s2c2a.logs.timed_motion import TimedMotion

START_WIDTH = 0.02
"""Half width of the backlash where the fit begins, relative to a drive's travel."""
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
            f"the first file, if the ends follow {1e3 * self.lag:.0f} ms later (motion "
            "shows only the difference of offset and lag; state join.offset if you know "
            f"it); its drift is {1e6 * self.drift:.0f} +- {1e6 * self.drift_std:.0f} "
            f"ppm; the drives explain {100 * self.explained:.0f} % of the motion"
        )


def estimate_clock(drives: TimedMotion, ends: TimedMotion) -> LogClock:
    """Conversion of times of the ends to the clock of the drives.

    Raises:
        LogError: there are too few rows, or the motion does not determine the offset.
    """
    _check_motion("drives", drives)
    _check_motion("ends", ends)
    begin = float(drives.time[0])
    ends_begin = float(ends.time[0])
    drives = drives.normalized()
    ends = ends.normalized()
    # interval of the grid of the search [s]
    rows = 2 * max(drives.interval, ends.interval)
    step = max(rows, drives.span / MAX_GRID, ends.span / MAX_GRID)
    # best fit; it must explain the motion, and clearly better than other offsets
    features = DriveFeatures(drives, min(len(ends.time), MAX_FITTED))
    fits = []
    for candidate in search_clocks(drives, ends, step):
        start = ClockParameters(
            candidate.offset, candidate.drift, step / 4, START_WIDTH
        )
        problem = ClockProblem(drives, ends, features, start, step)
        if problem.rows >= MIN_ROWS:
            fits.append(problem.fit())
    explained = max((fit.explained for fit in fits), default=0.0)
    if not explained > MIN_EXPLAINED:
        raise LogError(
            f"at no offset between the clocks do the drives explain more than "
            f"{100 * max(explained, 0.0):.0f} % of the motion of the ends "
            f"({100 * MIN_EXPLAINED:.0f} % are needed); check that the files belong "
            f"together, or {ADVICE}"
        )
    best = max(fits, key=lambda fit: fit.explained)
    for other in fits:
        apart = abs(other.parameters.offset - best.parameters.offset)
        ratio = (1 - explained) / (1 - other.explained)
        if apart > 2 * step and ratio > AMBIGUOUS:
            raise LogError(
                f"offsets between the clocks that differ by {apart:.3g} s explain "
                f"the motion about equally well, since it repeats itself; {ADVICE}"
            )
    deviations = best.problem.deviations(best)
    if not deviations.offset < drives.interval + ends.interval:
        raise LogError(
            f"the motion determines the offset between the clocks only within "
            f"{deviations.offset:.2g} s; {ADVICE}"
        )
    parameters = best.parameters
    return LogClock(
        offset=parameters.offset + begin - ends_begin,
        drift=parameters.drift,
        middle=ends.span / 2 + ends_begin,
        offset_std=deviations.offset,
        drift_std=deviations.drift,
        explained=best.explained,
        lag=parameters.lag,
    )


def _check_motion(name: str, motion: TimedMotion) -> None:
    if len(motion.time) < MIN_ROWS:
        raise LogError(
            f"{counted(len(motion.time), 'row')} with time and values of all {name}; "
            f"at least {MIN_ROWS} are needed to estimate the offset between the "
            f"clocks; {ADVICE}"
        )
    if not (np.ptp(motion.values, axis=0) > 0).any():
        raise LogError(
            f"the {name} do not move, so the offset between the clocks is unknown; "
            f"{ADVICE}"
        )
