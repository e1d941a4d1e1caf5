"""The centre-line of an arm, from states alone."""

import numpy as np
from jaxtyping import Float

from s2c2a.arm.geometry import centre_line as line_to_tip
from s2c2a.spaces import AXIS, POSITION, States

BASE_STATE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def centre_line(
    states: States, lengths: Float[np.ndarray, " modules"], points_per_module: int = 16
) -> Float[np.ndarray, "*batch points 3"]:
    """The arm's centre line [m] with the base as its first point, base frame; for drawing, not for kinematics.

    Args:
        states: end positions [m] and end axes, shape (*batch, modules, 6), base frame.
        lengths: module lengths [m], shape (modules,).
        points_per_module: points on each module after its first.
    """
    states = np.asarray(states, dtype=float)
    points = line_to_tip(states, np.asarray(lengths, dtype=float), points_per_module)
    return np.concatenate([np.zeros((*states.shape[:-2], 1, 3)), points], axis=-2)


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
