"""Array types that the drawing modules share."""

import numpy as np
from jaxtyping import Float

Point = Float[np.ndarray, "3"]
Points = Float[np.ndarray, "*batch 3"]
PlanePoints = Float[np.ndarray, "*batch 2"]
Obstacles = Float[np.ndarray, "*batch 12"]
"""Rows of `s2c2a.obstacles`."""
Series = Float[np.ndarray, " time"]
Goals = Float[np.ndarray, "time modules 3"]
"""Desired position [m] or axis of every module, NaN where it has none."""
