"""Configurations that a planner would choose for random positions of the tip.

They are solutions of the nominal inverse kinematics (arcs of constant curvature) with
small differences between neighboring modules, from random starts.

Backlash and elastic cables lose motion: a real arm needs larger commanded bends than the
nominal one, and does not reach every position. Each plan therefore assumes that a full
commanded bend results in a random share of it (`LEAST_GAIN` to one). Plans for positions
out of this reach have full bends.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from s2c2a.arm import ArmGeometry
from s2c2a.kinematics import commanded_part, states_from_bends
from s2c2a.kinematics.bends import squared_norm
from s2c2a.paper import disc_points
from s2c2a.spaces import POSITION

# all of these shape the recordings of `best`; others are other recordings
ITERATIONS = 25
DAMPING = 1e-3  # of the normal matrix, in squared units
LARGEST_STEP = 0.5  # shares of the full bend
EVENNESS = 0.03  # weight of bend differences [1/rad]
LIMIT_WEIGHT = 3.0  # of bends beyond the full bend
LENGTH_UNIT = 0.4  # of the arm's length; unit of position errors
TOLERANCE = 0.3  # of a plan's position error, in `LENGTH_UNIT`; a larger one failed
LEAST_GAIN = 0.7  # smallest share of a full commanded bend that the arm bends
CANDIDATES = 20  # positions of which one is chosen
CELL = 0.05  # of the arm's length: cells of positions that are equally likely


def nominal_plans(
    geometry: ArmGeometry, count: int, random: np.random.Generator
) -> Float[np.ndarray, "count modules 2"]:
    """Plans for positions of the tip that are spread over the workspace.

    Plans that end far from their positions are replaced by independent bends.

    Args:
        geometry: geometry of the arm.
        count: number of plans.
        random: source of positions, starts and gains.

    Returns:
        Bends, in shares of the full bend.
    """
    modules = len(geometry.lengths)
    lengths = jnp.asarray(geometry.lengths, jnp.float32)
    gains = random.uniform(LEAST_GAIN, 1.0, (count, 1))
    full = jnp.asarray(gains * geometry.action_bends, jnp.float32)
    positions = _spread_positions(geometry, count, random)
    starts = disc_points(random, (count, modules)) / 2.0
    start = jnp.asarray(starts, jnp.float32)
    bends, errors = _solve(start, positions, lengths, full, geometry.steerable)
    planned = np.asarray(bends, np.float64)
    planned /= np.maximum(np.linalg.norm(planned, axis=-1, keepdims=True), 1.0)
    independent = disc_points(random, (count, modules))
    is_near = np.asarray(errors) < TOLERANCE
    return np.where(is_near[:, None, None], planned, independent)


def _spread_positions(
    geometry: ArmGeometry, count: int, random: np.random.Generator
) -> Float[Array, "count 3"]:
    """Positions [m] that the nominal tip reaches, with equal density."""
    modules = len(geometry.lengths)
    shares = disc_points(random, (CANDIDATES, count, modules))
    bends = commanded_part(
        shares * geometry.action_bends[..., None], geometry.steerable
    )
    states = jax.jit(states_from_bends)(
        jnp.asarray(bends, jnp.float32), jnp.asarray(geometry.lengths, jnp.float32)
    )
    positions = np.asarray(states)[..., -1, POSITION]
    cells = np.floor(positions / (CELL * geometry.lengths.sum())).reshape(-1, 3)
    _cells, members, sizes = np.unique(
        cells, axis=0, return_inverse=True, return_counts=True
    )
    weights = 1.0 / sizes[members.ravel()].reshape(CANDIDATES, count)
    cumulative = np.cumsum(weights / weights.sum(axis=0), axis=0)
    chosen = (cumulative < random.uniform(size=count)).sum(axis=0)
    chosen = np.minimum(chosen, CANDIDATES - 1)
    return jnp.asarray(positions[chosen, np.arange(count)], jnp.float32)


@jax.jit
def _solve(
    starts: Float[Array, "count modules 2"],
    positions: Float[Array, "count 3"],
    lengths: Float[Array, " modules"],
    full: Float[Array, "count modules"],
    steerable: Float[np.ndarray, "modules 2 2"] | None,
) -> tuple[Float[Array, "count modules 2"], Float[Array, " count"]]:
    """Damped Gauss-Newton steps to all positions.

    Args:
        starts: first bends, in shares of the full bend.
        positions: of the tip [m].
        lengths: of the modules [m].
        full: bends of one share [rad].
        steerable: see `ArmGeometry`.

    Returns:
        Bends in shares of the full bend, and position errors in `LENGTH_UNIT`.
    """
    unit = LENGTH_UNIT * jnp.sum(lengths)

    def residuals(flat: Array, position: Array, full: Array) -> Array:
        shares = commanded_part(flat.reshape(-1, 2), steerable)
        bends = shares * full[:, None]
        tip = states_from_bends(bends, lengths)[-1, :3]
        excess = jnp.sqrt(squared_norm(shares) + 1e-9) - 1.0
        parts = (
            (tip - position) / unit,
            EVENNESS * jnp.diff(bends, axis=0).ravel(),
            LIMIT_WEIGHT * jnp.maximum(excess, 0.0),
        )
        return jnp.concatenate(parts)

    def solve(start: Array, position: Array, full: Array) -> tuple[Array, Array]:
        damping = DAMPING * jnp.eye(start.size)

        def iterate(_: int, flat: Array) -> Array:
            error = residuals(flat, position, full)
            slopes = jax.jacfwd(residuals)(flat, position, full)
            normal = slopes.T @ slopes + damping
            step = jnp.linalg.solve(normal, -slopes.T @ error)
            largest = jnp.max(jnp.abs(step)) + 1e-9
            return flat + step * jnp.minimum(1.0, LARGEST_STEP / largest)

        flat = jax.lax.fori_loop(0, ITERATIONS, iterate, start.ravel())
        error = residuals(flat, position, full)[:3]
        return flat.reshape(start.shape), jnp.linalg.norm(error)

    return jax.vmap(solve)(starts, positions, full)
