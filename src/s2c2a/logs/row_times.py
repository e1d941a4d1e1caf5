"""Times of the rows of a table: numbers in any unit, or time stamps."""

import numpy as np
from jaxtyping import Float

from s2c2a.files.tables import SECONDS
from s2c2a.logs.tables import Table

DAY = 86400.0  # s
EPOCH_UNITS = {"ns": 1e17, "us": 1e14, "ms": 1e11}
"""Smallest times since 1970 in these units: those of 1973. As seconds, 1e11 is 5138."""


def row_times(
    table: Table, column: str, unit: str | float | None
) -> Float[np.ndarray, " rows"]:
    """Time of each row [s].

    Args:
        table: has the column.
        column: of times; stamps are seconds already.
        unit: of the times, or its length in seconds; None: seconds, or the unit that the
            size of times since 1970 shows.
    """
    times = table.numbers[column]
    if column in table.stamps:
        # times of day that go on after midnight; others as they are
        known = np.isfinite(times)
        if times[known].max(initial=0.0) >= DAY:
            return times
        unwrapped = times.copy()
        unwrapped[known] = np.unwrap(times[known], period=DAY)
        return unwrapped
    if unit is None:
        unit = _epoch_unit(times)
    return times * (SECONDS[unit] if isinstance(unit, str) else unit)


def _epoch_unit(times: Float[np.ndarray, " rows"]) -> str:
    """Unit of times since 1970 by their size; seconds of all others."""
    known = times[np.isfinite(times)]
    smallest = known.min(initial=np.inf) if len(known) else 0.0
    fitting = [unit for unit, bound in EPOCH_UNITS.items() if smallest > bound]
    return fitting[0] if fitting else "s"
