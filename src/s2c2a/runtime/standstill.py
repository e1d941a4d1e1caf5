"""Gaps between the commands of a real arm: a stopped program, a suspended computer."""

import time

STANDSTILL = 2.0
"""Time beyond a control period [s] without a command, after which a real arm is held
until somebody asks it to resume: whoever is near it takes it for switched off."""


def time_with_sleep() -> float:
    """Return the time since a fixed origin [s], with that of a suspended computer.

    Without such a clock, a suspended computer shows no gap.
    """
    # `perf_counter` stands still while Linux and macOS are suspended
    number = getattr(time, "CLOCK_BOOTTIME", getattr(time, "CLOCK_MONOTONIC", None))
    return time.perf_counter() if number is None else time.clock_gettime(number)
