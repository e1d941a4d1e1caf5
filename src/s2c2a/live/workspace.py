"""Where an arm can be, each module an arc: its ends for bends drawn at random, and how far a point is from reach."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.kinematics import states_from_bends
from s2c2a.live.page import Survey
from s2c2a.live.request import Point
from s2c2a.planning import reach_gaps
from s2c2a.spaces import POSITION

POINTS = 400


def workspace(arm: ArmSpec, points: int = POINTS, seed: int = 0) -> Float[np.ndarray, "modules points 3"]:
    """Ends of the modules [m], base frame, all modules' bends even in their discs; shape (modules, points, 3)."""
    geometry, random = ArmGeometry.of(arm), np.random.default_rng(seed)
    turns = random.uniform(0, 2 * np.pi, (points, arm.module_count))
    sizes = geometry.bend_limits * np.sqrt(random.uniform(0, 1, turns.shape))
    bends = sizes[..., None] * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    states = _states(jnp.asarray(bends, jnp.float32), jnp.asarray(geometry.lengths, jnp.float32))
    return np.swapaxes(np.asarray(states)[..., POSITION], 0, 1)


def survey(arm: ArmSpec) -> Survey:
    """Cloud and gaps; what tells gaps is compiled here."""

    def gap(position: Point) -> float:
        return float(reach_gaps(arm, np.array([position]))[0])

    gap((0.0, 0.0, arm.length))
    return Survey(workspace(arm), gap)


_states = jax.jit(states_from_bends)
