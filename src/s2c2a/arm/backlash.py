"""Play operator: backlash and friction between what drives and what follows.

The output stays until one end of a band around the input takes it along (Brokate and
Sprekels, Hysteresis and Phase Transitions, 1996, ch. 2).
"""

from typing import TypeVar

import numpy as np
from jaxtyping import Float

Path = Float[np.ndarray, "steps *shape"]
AnyArray = TypeVar("AnyArray")  # of NumPy or JAX


def play(last: AnyArray, low: AnyArray, high: AnyArray) -> AnyArray:
    """The next output of a play operator.

    It is that of a path too if the path is monotone.

    Args:
        last: the last output.
        low: lower end of the band around the input.
        high: upper end.
    """
    return last.clip(low, high)  # type: ignore[attr-defined]


def play_along(start: Float[np.ndarray, "*shape"], low: Path, high: Path) -> Path:
    """Outputs of a play operator along a path, from a first output on."""
    outputs = np.empty_like(low)
    last = start
    for step in range(len(low)):
        last = play(last, low[step], high[step])
        outputs[step] = last
    return outputs
