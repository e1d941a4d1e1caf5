"""Measurements that repeat the last one, bit by bit.

A sensor that runs has noise in its last bits, so an exact repetition means that the same
measurement was handed out again. This is the one place that decides whether a
measurement is new: live (`RepeatDetector`) and in recorded rows (`repeated_rows`).
"""

import numpy as np
from jaxtyping import Bool, Float


class RepeatDetector:
    """Distinguishes new measurements of named sensors from repeated ones, bit by bit."""

    def __init__(self) -> None:
        """A detector without any measurement."""
        self._last_bytes: dict[str, bytes] = {}

    def is_repeated(self, name: str, values: np.ndarray) -> bool:
        """Whether values equal the last ones of the same name to the last bit.

        Args:
            name: of the sensor.
            values: its measurement, of any shape and type; kept for the next call.
        """
        current = values.tobytes()
        repeated = self._last_bytes.get(name) == current
        self._last_bytes[name] = current
        return repeated


def repeated_rows(
    values: Float[np.ndarray, "rows numbers"],
) -> Bool[np.ndarray, " rows"]:
    """Whether each row equals the row before it; numbers that are NaN in both are equal.

    Args:
        values: measurements of one sensor.
    """
    last = values[:-1]
    rest = values[1:]
    equal = (rest == last) | (np.isnan(rest) & np.isnan(last))
    return np.concatenate([np.zeros(min(len(values), 1), bool), equal.all(axis=1)])
