"""How well a network does on data that it has not seen."""

import numpy as np
from jaxtyping import Float


def percent_error(
    predicted: Float[np.ndarray, "samples modules outputs"],
    true: Float[np.ndarray, "samples modules outputs"],
    ranges: Float[np.ndarray, "modules outputs"],
) -> tuple[float, float]:
    """Mean and standard deviation of |error| over samples and outputs, in percent of each output's full range."""
    percent = 100.0 * np.abs(predicted - true) / ranges
    return float(percent.mean()), float(percent.std())


def full_ranges(values: Float[np.ndarray, "samples modules outputs"]) -> Float[np.ndarray, "modules outputs"]:
    """Largest less smallest value of every output; one for an output that never changes."""
    ranges = np.ptp(values, axis=0)
    return np.where(ranges > 0, ranges, 1.0)
