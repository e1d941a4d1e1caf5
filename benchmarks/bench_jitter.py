"""The recipe `best` at 100 Hz with a real clock, and its memory over many ticks."""

import resource
import time
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from s2c2a.tasks import circle

from driving import ticks_on, times_over

# s
PERIOD = 0.01
TICKS = 10_000
SPUN = 1e-3  # s before a deadline that are not slept, since sleep comes back late
ROUNDS = 10
TICKS_A_ROUND = 10_000
STATM = Path("/proc/self/statm")


@pytest.fixture
def tick(networks_of):
    networks = networks_of("best")
    return ticks_on(networks, circle(networks.arm))


@pytest.mark.asked("at most 0.1 % missed")
def test_ticks_on_time(benchmark, tick):
    """One missed ends after the next was to begin; the timetable stays as it is."""
    times_over(tick, 100)()
    numbers = count()
    start = time.perf_counter() + PERIOD
    late = []

    def wait() -> None:
        due = start + next(numbers) * PERIOD
        time.sleep(max(0.0, due - time.perf_counter() - SPUN))
        while time.perf_counter() < due:
            pass
        late.append(time.perf_counter() - due)

    benchmark.pedantic(tick, setup=wait, rounds=TICKS)
    if benchmark.stats:
        missed = np.sum(np.array(late) + benchmark.stats.stats.data > PERIOD)
        benchmark.extra_info |= {
            "missed": f"{missed} of {TICKS}",
            "late at most [ms]": 1e3 * max(late),
        }


@pytest.mark.asked("growth of at most 1 MiB")
@pytest.mark.skipif(
    not STATM.is_file(),
    reason="this system does not tell how much memory a process holds",
)
def test_memory_over_ticks(benchmark, tick):
    """From the end of the first tenth."""
    held = []
    benchmark.pedantic(
        times_over(tick, TICKS_A_ROUND),
        setup=lambda: held.append(resident()),
        rounds=ROUNDS,
    )
    grown = resident() - held[min(1, len(held) - 1)]
    benchmark.extra_info |= {"held [MiB]": held[-1], "grown [MiB]": grown}


def resident() -> float:
    """Memory that this process holds [MiB]."""
    return (
        int(STATM.read_text(encoding="ascii").split()[1])
        * resource.getpagesize()
        / 2**20
    )
