"""States of which only a part was seen, completed for drawing: one arc from each end that is known to the next."""

import numpy as np
from jaxtyping import Float

from s2c2a.spaces import AXIS, POSITION

UP = np.array([0.0, 0.0, 1.0])


def completed(
    states: Float[np.ndarray, "modules 6"], lengths: Float[np.ndarray, " modules"]
) -> Float[np.ndarray, "modules 6"]:
    """States as they would be drawn; what was seen stays.

    From a known end, or the base, an arc leaves along the axis there and reaches the
    next known end; modules between share its way evenly. An axis that was not seen is
    the arc's own. Beyond the last known end the arm is straight.

    Args:
        states: end positions [m] and axes, base frame, or NaN.
        lengths: of the modules [m].
    """
    states = np.array(states, float)
    before = -1
    position = np.zeros(3)
    axis = UP
    for module in map(
        int, np.flatnonzero(np.isfinite(states[:, POSITION]).all(axis=1))
    ):
        way = states[module, POSITION] - position
        for inner in range(before + 1, module + 1):
            point, tangent = _on_arc(way, axis, (inner - before) / (module - before))
            if not np.isfinite(states[inner, POSITION]).all():
                states[inner, POSITION] = position + point
            if not np.isfinite(states[inner, AXIS]).all():
                states[inner, AXIS] = tangent
        before = module
        position = states[module, POSITION]
        axis = states[module, AXIS]
    for module in range(before + 1, len(states)):
        position = position + lengths[module] * axis
        states[module] = *position, *axis
    return states


def _on_arc(
    way: np.ndarray, axis: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Point and tangent at a share of the arc that leaves along an axis and ends after a way."""
    length = np.linalg.norm(way)
    chord = way / length if length > 0 else axis
    half = np.arccos(np.clip(chord @ axis, -1.0, 1.0))  # between axis and chord
    across = chord - (chord @ axis) * axis
    if half < 1e-6 or half > np.pi - 1e-3:
        return share * way, axis
    across = across / np.linalg.norm(across)
    reach = length * np.sin(share * half) / np.sin(half)
    return reach * _leaning(axis, across, share * half), _leaning(
        axis, across, 2 * share * half
    )


def _leaning(axis: np.ndarray, across: np.ndarray, angle: float) -> np.ndarray:
    return np.cos(angle) * axis + np.sin(angle) * across
