"""Timing in turn, and ticks on time, with clocks that tests set."""

from itertools import count

import numpy as np
import pytest

from s2c2a.bench.jitter import RealClock, memory_over_ticks, on_time, paced
from s2c2a.bench.timing import taken_in_turn


def test_calls_are_taken_in_turn_after_a_warm_up_of_a_tenth():
    taken = []
    calls = {name: lambda number, name=name: taken.append((name, number)) for name in "AB"}
    taken_in_turn(calls, repeats=20)
    assert taken[:4] == [("A", 0), ("B", 0), ("A", 1), ("B", 1)]
    assert taken[4:] == [(name, number) for number in range(20) for name in "AB"]


def test_every_call_gets_the_time_between_its_own_begin_and_end():
    ticking = count()
    times = taken_in_turn({"A": lambda _: next(ticking), "B": lambda _: None}, 5, clock=lambda: float(next(ticking)))
    np.testing.assert_array_equal(times["A"], np.full(5, 2.0))
    np.testing.assert_array_equal(times["B"], np.ones(5))


def test_progress_ends_with_all_repeats():
    told = []
    taken_in_turn({"A": lambda _: None}, 50, lambda done, total: told.append((done, total)))
    assert told[-1] == (50, 50)
    assert len(told) < 30


class SetClock:
    """A clock that stands still while nothing waits or works."""

    def __init__(self):
        self.time = 0.0

    def now(self) -> float:
        return self.time

    def wait_until(self, moment: float) -> None:
        self.time = max(self.time, moment)


def test_a_tick_that_takes_too_long_is_missed_and_the_timetable_stays():
    clock = SetClock()
    took = [0.2, 2.5, 0.2, 0.2, 0.2]  # the second one runs into the time of the third and of the fourth
    warm_up = iter([0.0])

    def tick(number: int) -> None:
        clock.time += next(warm_up, took[number])

    run = paced(tick, ticks=5, period=1.0, clock=clock)
    np.testing.assert_allclose(run.took, took)
    np.testing.assert_allclose(run.late, [0.0, 0.0, 1.5, 0.7, 0.0], atol=1e-12)
    assert run.missed == 2  # the second and the third, which ends 1.7 after its time


def test_ticks_that_just_fit_are_not_missed():
    clock = SetClock()

    def tick(number: int) -> None:
        clock.time += 0.75

    assert paced(tick, ticks=10, period=1.0, clock=clock).missed == 0


def test_the_real_clock_does_not_come_back_early():
    clock = RealClock()
    moment = clock.now() + 0.005
    clock.wait_until(moment)
    assert moment <= clock.now() < moment + 0.5
    clock.wait_until(moment)  # over already: at once


def test_ticks_on_time_and_their_memory_are_measured(tiny_networks):
    missed, late, took = on_time(tiny_networks, 5, lambda done, total: None)
    assert missed.unit == "%"
    assert late.repeats == took.repeats == 5
    assert took.median > 0
    held, grown = memory_over_ticks(tiny_networks, 60, lambda done, total: None)
    assert held.median > 10.0
    assert grown.median < 50.0


@pytest.mark.parametrize("ticks", [1, 2])
def test_few_ticks_can_be_watched_too(tiny_networks, ticks):
    lines = list(memory_over_ticks(tiny_networks, ticks, lambda done, total: None))
    assert lines
