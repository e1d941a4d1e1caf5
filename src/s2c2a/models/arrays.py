"""Array types that the models share."""

import numpy as np
from jaxtyping import Array, Float

PerModule = Float[Array, " modules"]
ModuleBends = Float[Array, "modules 2"]
Bends = Float[Array, "*batch modules 2"]
Configuration = Float[Array, "modules 3"]
Configurations = Float[Array, "*batch modules 3"]
Actions = Float[Array, "*batch modules cables"]
"""Also displacements over the cable radius [rad]."""
Matrices = Float[Array, "modules cables 2"]
Deviations = Float[Array, "*batch modules"]
FeatureRows = Float[np.ndarray, "samples features"]
OutputRows = Float[np.ndarray, "samples outputs"]
