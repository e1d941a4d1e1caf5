"""Waiting for other threads and processes."""

import time


def until(condition, seconds: float = 300.0, what: str = "the condition") -> None:
    """Wait until a condition is true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f"{what} was not met within {seconds:g} s"
        time.sleep(0.01)
