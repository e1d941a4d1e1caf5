"""What no recording told of an arm, since it came about later: what hangs at its tip, and how its modules lean."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from s2c2a.kinematics.chain import states_from_bends


class Disturbances(NamedTuple):
    """As far as they are known.

    Attributes:
        load: at the tip [kg].
        leans: of modules, beside what they are expected to bend by [rad], shape
            (modules, 2): errors of homing, drift, cables that became softer, and
            whatever else pushes.
    """

    load: Float[Array, ""]
    leans: Float[Array, "modules 2"]

    @classmethod
    def none(cls, modules: int) -> "Disturbances":
        """As when the data were recorded."""
        return cls(jnp.zeros(()), jnp.zeros((modules, 2)))


def moments_of_weights(
    weights: Float[Array, " modules"],
    bends: Float[Array, "*batch modules 2"],
    lengths: Float[Array, "*#batch modules"],
    compliances: Float[Array, " modules"],
    gravity: Float[Array, "3"],
) -> Float[Array, "*batch modules 2"]:
    """Moments over the bending stiffness that weights at modules' ends bend them by [rad]: C_i sum_j w_j dp_j/db_i . g.

    Args:
        weights: w [kg].
        bends: where the modules are [rad].
        lengths: of modules [m].
        compliances: C, length over bending stiffness [rad/(N m)].
        gravity: [m/s2], base frame.
    """

    def work(bends):
        return jnp.sum((states_from_bends(bends, lengths)[..., :3] @ gravity) * weights)

    return compliances[:, None] * jax.grad(work)(bends)
