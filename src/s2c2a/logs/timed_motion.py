"""Motion of drives or ends by a clock of their own."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class TimedMotion(NamedTuple):
    """Values of drives or ends by their own clock.

    Attributes:
        time: increasing times [s].
        values: finite values in any unit.
    """

    time: Float[np.ndarray, " rows"]
    values: Float[np.ndarray, "rows channels"]

    @property
    def interval(self) -> float:
        """Median interval of the rows [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def span(self) -> float:
        """Time from the first row to the last one [s]."""
        return float(self.time[-1] - self.time[0])

    def normalized(self) -> "TimedMotion":
        """Times since the first row, and moving channels with unit scale.

        A clock since 1970 leaves few digits. The scale is that of quantiles, which are
        robust to outliers.
        """
        low, high = np.quantile(self.values, [0.05, 0.95], axis=0)
        if not (high > low).any():
            low = self.values.min(axis=0)
            high = self.values.max(axis=0)
        moves = high > low
        centered = self.values - low
        scale = high - low
        return TimedMotion(
            time=self.time - self.time[0], values=centered[:, moves] / scale[moves]
        )
