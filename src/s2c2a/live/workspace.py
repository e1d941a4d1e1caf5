"""Where an arm can be, each module an arc: its ends for bends drawn at random, and how far a point is from reach."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import states_from_bends
from s2c2a.live.page import Survey
from s2c2a.planning import reach_gaps
from s2c2a.spaces import POSITION, Bends, States


def workspace(
    arm: ArmSpec, points: int = 400, seed: int = 0
) -> Float[np.ndarray, "modules points 3"]:
    """Ends of the modules [m], base frame, all modules' bends even in their discs; shape (modules, points, 3)."""
    random = np.random.default_rng(seed)
    turns = random.uniform(0, 2 * np.pi, (points, arm.module_count))
    sizes = ArmGeometry.of(arm).bend_limits * np.sqrt(random.uniform(0, 1, turns.shape))
    return np.swapaxes(arcs(arm, bends_of(sizes, turns))[..., POSITION], 0, 1)


def bends_of(sizes: np.ndarray, turns: np.ndarray) -> Bends:
    """Bends [rad] of these sizes towards these directions [rad]; two more at the end of their shape."""
    return sizes[..., None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)


def arcs(arm: ArmSpec, bends: Bends) -> States:
    """States [m] of an arm whose modules are arcs, bends in [rad], shape (*batch, modules, 2)."""
    lengths = jnp.asarray(ArmGeometry.of(arm).lengths, jnp.float32)
    return np.asarray(_states(jnp.asarray(bends, jnp.float32), lengths), dtype=float)


def survey(arm: ArmSpec) -> Survey:
    """Cloud and gaps; what tells gaps is compiled here."""
    reach_gaps(arm, np.array([(0.0, 0.0, arm.length)]))
    return workspace(arm), lambda position: float(
        reach_gaps(arm, np.array([position]))[0]
    )


_states = jax.jit(states_from_bends)
