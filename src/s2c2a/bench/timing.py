"""Timing calls in turn: A B A B ..., so that whatever else the machine does falls on all of them alike."""

import time
from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

Call = Callable[[int], object]
"""Takes the number of the repeat and returns when the work is done."""

Progress = Callable[[str, int, int], None]
"""Told what is being done, how many parts of it are done, and how many there are."""

WARM_UP = 10  # one repeat in so many is done before and not counted
TELL = 20  # times of progress


def taken_in_turn(
    calls: Mapping[str, Call],
    repeats: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
    clock: Callable[[], float] = time.perf_counter,
    at_a_time: int = 1,
) -> dict[str, Float[np.ndarray, " repeats"]]:
    """Times of every call [s].

    Args:
        calls: name -> call.
        repeats: of each, at least one.
        progress: told how many repeats of how many are done.
        clock: says the time [s].
        at_a_time: repeats of a call before the next has its turn; more than one where each leaves the caches empty.
    """
    for number in range(-(-repeats // WARM_UP)):
        for call in calls.values():
            call(number)
    times = {name: np.empty(repeats) for name in calls}
    told = 0
    for first in range(0, repeats, at_a_time):
        turn = range(first, min(first + at_a_time, repeats))
        for name, call in calls.items():
            for number in turn:
                began = clock()
                call(number)
                times[name][number] = clock() - began
        if first >= told:
            progress(first, repeats)
            told += -(-repeats // TELL)
    progress(repeats, repeats)
    return times
