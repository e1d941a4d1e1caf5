"""Completion of partly observed arm states for drawing, by arcs between known ends."""

import numpy as np
from jaxtyping import Float

from s2c2a.spaces import AXIS, POSITION, States
from s2c2a.viz.mesh import unit


def completed(states: States, lengths: Float[np.ndarray, " modules"]) -> States:
    """Complete the missing positions and axes of one arm's states.

    An arc leaves the base, or a known end, along the axis there and ends at the next
    known end. The modules between share the arc evenly. A missing axis is the tangent
    of the arc. The arm is straight beyond the last known end.

    Args:
        states: end positions [m] and axes, base frame; NaN where unknown.
        lengths: of the modules [m].

    Returns:
        States without NaN; known values are unchanged.
    """
    states = np.array(states, float)
    known = np.isfinite(states[:, POSITION]).all(axis=1)
    previous = -1
    position = np.zeros(3)
    axis = np.array([0.0, 0.0, 1.0])
    for module in map(int, np.flatnonzero(known)):
        chord = states[module, POSITION] - position
        for inner in range(previous + 1, module + 1):
            share = (inner - previous) / (module - previous)
            point, tangent = _arc_point(chord, axis, share)
            if not known[inner]:
                states[inner, POSITION] = position + point
            if not np.isfinite(states[inner, AXIS]).all():
                states[inner, AXIS] = tangent
        previous = module
        position = states[module, POSITION]
        axis = states[module, AXIS]
    for module in range(previous + 1, len(states)):
        position = position + lengths[module] * axis
        states[module] = *position, *axis
    return states


def _arc_point(
    chord: np.ndarray, axis: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Point and tangent at a share of the arc along `axis` that spans `chord`."""
    length = np.linalg.norm(chord)
    direction = chord / length if length > 0 else axis
    half_angle = np.arccos(np.clip(direction @ axis, -1.0, 1.0))
    if half_angle < 1e-6 or half_angle > np.pi - 1e-3:
        return share * chord, axis
    normal = unit(direction - (direction @ axis) * axis)
    angle = share * half_angle
    reach = length * np.sin(angle) / np.sin(half_angle)
    point = reach * _rotate(axis, normal, angle)
    return point, _rotate(axis, normal, 2 * angle)


def _rotate(axis: np.ndarray, normal: np.ndarray, angle: float) -> np.ndarray:
    return np.cos(angle) * axis + np.sin(angle) * normal
