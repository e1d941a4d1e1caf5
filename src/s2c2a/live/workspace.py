"""Where the modules' ends can be: bends drawn at random, each module an arc."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import states_from_bends
from s2c2a.spaces import POSITION

POINTS = 700


def workspace(arm: ArmSpec, points: int = POINTS, seed: int = 0) -> Float[np.ndarray, "modules points 3"]:
    """Ends of the modules [m], base frame, all modules' bends even in their discs; shape (modules, points, 3)."""
    geometry, random = ArmGeometry.of(arm), np.random.default_rng(seed)
    turns = random.uniform(0, 2 * np.pi, (points, arm.module_count))
    sizes = geometry.bend_limits * np.sqrt(random.uniform(0, 1, turns.shape))
    bends = sizes[..., None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    states = _states(jnp.asarray(bends, jnp.float32), jnp.asarray(geometry.lengths, jnp.float32))
    return np.swapaxes(np.asarray(states)[..., POSITION], 0, 1)


_states = jax.jit(states_from_bends)
