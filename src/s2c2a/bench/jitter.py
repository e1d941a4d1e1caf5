"""Ticks on time: a strategy at 100 Hz with a real clock, and its memory over many ticks."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from jaxtyping import Float

from s2c2a.bench.machine import resident_memory
from s2c2a.bench.measurement import Limit, Measurement, Skipped, timing
from s2c2a.bench.options import BenchOptions
from s2c2a.bench.step import seen_on, ticking
from s2c2a.bench.timing import TELL, WARM_UP, Call, Progress
from s2c2a.experiments.workshop import Workshop
from s2c2a.strategies import TrainedNetworks, recipe_named, s2c2a_strategy
from s2c2a.tasks import circle

RATE = 100.0  # Hz
SPUN = 1e-3  # s before a deadline that are not slept, since sleep comes back late
MISSED_LIMIT = Limit(0.1)  # % of ticks
GROWTH_LIMIT = Limit(1.0)  # MiB


class Clock(Protocol):
    """Tells the time and waits."""

    def now(self) -> float:
        """Time [s]."""

    def wait_until(self, moment: float) -> None:
        """Come back at that time [s], or at once if it is over."""


class RealClock:
    """The machine's clock: sleeps nearly as long as it may, then spins."""

    def now(self) -> float:
        """See `Clock`."""
        return time.perf_counter()

    def wait_until(self, moment: float) -> None:
        """See `Clock`."""
        if (left := moment - self.now() - SPUN) > 0:
            time.sleep(left)
        while self.now() < moment:
            pass


@dataclass(frozen=True)
class Paced:
    """Ticks that were to begin every period.

    Attributes:
        late: how long after its time each tick began [s], shape (ticks,).
        took: how long it took [s], shape (ticks,).
        missed: how many ticks ended after the next one was to begin.
    """

    late: Float[np.ndarray, " ticks"]
    took: Float[np.ndarray, " ticks"]
    missed: int


def measure(options: BenchOptions, progress: Progress) -> Iterator[Measurement | Skipped]:
    """The recipe `best` on the circle, on time and then as fast as it can."""
    networks = Workshop(progress=progress).networks(options.arm, recipe_named("best"), options.seed)
    yield from on_time(networks, options.ticks, partial(progress, f"ticks at {RATE:g} Hz"))
    yield from memory_over_ticks(networks, options.memory_ticks, partial(progress, "ticks while memory is watched"))


def on_time(networks: TrainedNetworks, ticks: int, progress: Callable[[int, int], None]) -> Iterator[Measurement]:
    """Missed deadlines, lateness and duration of ticks at 100 Hz."""
    run = paced(_tick(networks), ticks, 1.0 / RATE, RealClock(), progress)
    share = 100.0 * run.missed / ticks
    yield Measurement(
        f"deadlines missed at {RATE:g} Hz", "%", share, None, ticks, MISSED_LIMIT, note=f"{run.missed} of {ticks}"
    )
    yield timing("ticks begin late by", run.late, note=f"at most {1e3 * run.late.max():.2f} ms")
    yield timing("ticks take", run.took, note=f"at most {1e3 * run.took.max():.2f} ms")


def paced(
    tick: Call,
    ticks: int,
    period: float,
    clock: Clock,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Paced:
    """Do a tick every period [s]; a tick whose time is over begins at once, and the timetable stays as it is."""
    for number in range(-(-ticks // WARM_UP)):
        tick(number)
    began, ended = np.empty(ticks), np.empty(ticks)
    start = clock.now() + period
    for number in range(ticks):
        clock.wait_until(start + number * period)
        began[number] = clock.now()
        tick(number)
        ended[number] = clock.now()
        if number % -(-ticks // TELL) == 0:
            progress(number, ticks)
    progress(ticks, ticks)
    due = start + period * np.arange(ticks)
    return Paced(began - due, ended - began, int((ended > due + period).sum()))


def memory_over_ticks(
    networks: TrainedNetworks, ticks: int, progress: Callable[[int, int], None]
) -> Iterator[Measurement | Skipped]:
    """Resident memory after the first tenth of the ticks, and by how much it grows over the rest."""
    tick = _tick(networks)
    held = []
    for number in range(ticks):
        tick(number)
        if (number + 1) % -(-ticks // TELL) == 0:
            held.append(resident_memory())
            progress(number + 1, ticks)
    known = [memory for memory in held if memory is not None]
    if len(known) < 3:
        yield Skipped("memory over ticks", "this system does not tell how much memory a process holds")
        return
    begin = max(0, len(known) // WARM_UP - 1)
    yield Measurement("memory held", "MiB", known[begin], None, ticks, note=f"at the end {known[-1]:.1f} MiB")
    yield Measurement(f"it grows over {ticks} ticks by", "MiB", known[-1] - known[begin], None, ticks, GROWTH_LIMIT)


def _tick(networks: TrainedNetworks) -> Call:
    task = circle(networks.arm)
    return ticking(s2c2a_strategy(networks), task, seen_on(networks, task))
