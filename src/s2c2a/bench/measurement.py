"""What a benchmark measures: one line of its tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Limit:
    """What a measurement on `twin_arm` is held to.

    Attributes:
        median: at most so much, or at least where less is worse.
        percentile_99: the same for the 99th percentile, if anything.
        at_least: whether less is worse.
    """

    median: float
    percentile_99: float | None = None
    at_least: bool = False

    def kept(self, median: float, percentile_99: float | None) -> bool:
        """Whether a measurement keeps it."""
        if self.at_least:
            return median >= self.median
        tail = percentile_99 is None or self.percentile_99 is None or percentile_99 <= self.percentile_99
        return median <= self.median and tail


@dataclass(frozen=True)
class Measurement:
    """One line of a table.

    Attributes:
        what: was measured.
        unit: "s", "MiB", "MB", "Mop", "Gop/s", "%", "1", "x" for ratios, "arm s/s" for arm seconds simulated in a
            second.
        median: over the repeats; the value itself where there is but one.
        percentile_99: over the repeats; of a speed the slow end, which 99 of 100 exceed.
        repeats: how often it was measured.
        limit: what it is held to, if anything.
        error: what the speed is bought with, if anything: distance from the true tip [m].
        note: what a reader needs beside the number.
    """

    what: str
    unit: str
    median: float
    percentile_99: float | None = None
    repeats: int = 1
    limit: Limit | None = None
    error: float | None = None
    note: str = ""

    @property
    def kept(self) -> bool | None:
        """Whether it keeps its limit; None without one."""
        return None if self.limit is None else self.limit.kept(self.median, self.percentile_99)


@dataclass(frozen=True)
class Skipped:
    """What could not be measured here, and why."""

    what: str
    why: str


@dataclass(frozen=True)
class Growth:
    """How a time grows with the size of a thing, over at least two sizes.

    Attributes:
        of: what grows, such as "modules".
        what: is timed, such as "plan, best".
        sizes: how many, rising, shape (sizes,).
        medians: [s], shape (sizes,).
        percentiles_99: [s], shape (sizes,).
        repeats: at every size.
    """

    of: str
    what: str
    sizes: Sequence[int]
    medians: Sequence[float]
    percentiles_99: Sequence[float]
    repeats: int

    @property
    def slope(self) -> float:
        """Exponent of the power law that fits best, over the sizes above zero: one is linear."""
        sizes, medians = np.array(self.sizes, dtype=float), np.array(self.medians)
        there = sizes > 0
        return float(np.polyfit(np.log(sizes[there]), np.log(medians[there]), 1)[0])

    @property
    def steepest(self) -> float:
        """Largest exponent between neighbouring sizes above zero."""
        sizes, medians = np.array(self.sizes, dtype=float), np.array(self.medians)
        there = sizes > 0
        return float((np.diff(np.log(medians[there])) / np.diff(np.log(sizes[there]))).max())


def timing(what: str, seconds: np.ndarray, limit: Limit | None = None, note: str = "") -> Measurement:
    """A measurement of times [s]; of one time alone there is no percentile."""
    tail = float(np.percentile(seconds, 99)) if len(seconds) > 1 else None
    return Measurement(what, "s", float(np.median(seconds)), tail, len(seconds), limit, note=note)


def speed(
    what: str, seconds: np.ndarray, limit: Limit | None = None, error: float | None = None, note: str = ""
) -> Measurement:
    """Arm seconds simulated in a second, from times that arm seconds took [s]."""
    tail = float(1.0 / np.percentile(seconds, 99)) if len(seconds) > 1 else None
    return Measurement(what, "arm s/s", float(1.0 / np.median(seconds)), tail, len(seconds), limit, error, note)


def memory(what: str, held: Sequence[float]) -> Measurement:
    """A measurement of memory [MiB]."""
    tail = float(np.percentile(held, 99)) if len(held) > 1 else None
    return Measurement(what, "MiB", float(np.median(held)), tail, len(held))


def ratio(what: str, slow: np.ndarray, fast: np.ndarray, limit: Limit | None = None, note: str = "") -> Measurement:
    """Ratio of the medians of times taken in turn."""
    times = float(np.median(slow) / np.median(fast))
    return Measurement(what, "x", times, None, min(len(slow), len(fast)), limit, note=note)


def growing(
    of: str, what: str, sizes: Sequence[int], times: Sequence[np.ndarray], limit: Limit | None = None
) -> Iterator[Measurement | Growth]:
    """A growth from the times of every size [s], and the exponent that fits it."""
    medians, tails = ([float(np.percentile(seconds, share)) for seconds in times] for share in (50, 99))
    growth = Growth(of, what, tuple(sizes), tuple(medians), tuple(tails), len(times[0]))
    yield growth
    note = f"{sizes[0]} to {sizes[-1]}; steepest between neighbours {growth.steepest:.2f}"
    yield Measurement(f"exponent of {of}: {what}", "1", growth.slope, None, growth.repeats, limit, note=note)
