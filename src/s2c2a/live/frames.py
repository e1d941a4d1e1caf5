"""The rate at which things are shown."""

import math
import threading
import time
from collections.abc import Iterator


def frames(period: float, over: threading.Event) -> Iterator[float]:
    """Moments a period apart until it is over, and how long the one before was ago [s].

    Moments that pass while something is drawn are left out: others get their turn before the next one.
    """
    begun, number, before = time.perf_counter(), 0, 0.0
    while not over.wait(max(0.0, begun + number * period - time.perf_counter())):
        now = time.perf_counter() - begun
        yield now - before
        before = now
        number = max(number + 1, math.ceil((time.perf_counter() - begun) / period))
