"""The centre-line of an arm, from states alone."""

import numpy as np
from jaxtyping import Float

from s2c2a.spaces import AXIS, POSITION, States

BASE_STATE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def centre_line(
    states: States, lengths: Float[np.ndarray, " modules"], points_per_module: int = 16
) -> Float[np.ndarray, "*batch points 3"]:
    """A smooth curve from the base through every module end, along the end axis there.

    Each module is a cubic Hermite curve whose end tangents are as long as the module: exact for a straight module, and
    within 1.1 % of its length for a constant bend of 90 degrees. For drawing, not for kinematics.

    Args:
        states: end positions [m] and end axes, shape (*batch, modules, 6), base frame.
        lengths: module lengths [m], shape (modules,).
        points_per_module: points on each module after its first.

    Returns:
        Points [m] from base to tip, shape (*batch, points_per_module * modules + 1, 3), base frame.
    """
    states = np.asarray(states, dtype=float)
    base = np.broadcast_to(BASE_STATE, (*states.shape[:-2], 1, 6))
    starts = np.concatenate([base, states[..., :-1, :]], axis=-2)
    tangents = np.asarray(lengths, dtype=float)[:, None]
    knots = [starts[..., POSITION], tangents * starts[..., AXIS], states[..., POSITION], tangents * states[..., AXIS]]
    basis = _hermite_basis(np.arange(1, points_per_module + 1) / points_per_module)
    curves = np.einsum("pk,...mkx->...mpx", basis, np.stack(knots, axis=-2))
    points = curves.reshape(*states.shape[:-2], -1, 3)  # (*batch, modules * points_per_module, 3)
    return np.concatenate([base[..., POSITION], points], axis=-2)


def arc_lengths(states: Float[np.ndarray, "time modules 6"]) -> Float[np.ndarray, " modules"]:
    """How long modules must be [m] to end where they do, each taken for an arc; the median over time.

    An arc over the chord d that turns by the angle a between the axes at its ends is d (a/2) / sin(a/2) long: exact for
    a constant bend, whatever its angle. For drawing runs of which the arm is not known.

    Args:
        states: end positions [m] and end axes, shape (time, modules, 6), base frame, all finite.
    """
    base = np.broadcast_to(BASE_STATE, (len(states), 1, 6))
    starts = np.concatenate([base, states[:, :-1]], axis=1)
    chords = np.linalg.norm(states[..., POSITION] - starts[..., POSITION], axis=-1)
    half_chords = np.linalg.norm(states[..., AXIS] - starts[..., AXIS], axis=-1) / 2  # of the unit circle: sin(a/2)
    halves = np.arcsin(np.clip(half_chords, 0.0, 1.0))
    return np.median(chords / np.sinc(halves / np.pi), axis=0)


def _hermite_basis(u: Float[np.ndarray, " points"]) -> Float[np.ndarray, "points 4"]:
    """Weights of start, start tangent, end and end tangent at u in [0, 1]."""
    return np.stack([2 * u**3 - 3 * u**2 + 1, u**3 - 2 * u**2 + u, -2 * u**3 + 3 * u**2, u**3 - u**2], axis=-1)
