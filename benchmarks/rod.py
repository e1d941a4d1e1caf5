"""The resting shape of a cable-driven arm as an elastic rod, an independent reference.

The arm is a Kirchhoff rod (Antman 2005, ch. 8): it bends (EI) and twists (GJ) but
neither stretches nor shears. At arc length s let p be the center line, R = [d1 d2 d3]
the cross-section's frame, n and m the force and moment in rod and cables together, w
the weight per length and u the curvature in the cross-section's frame:

    p' = d3,   R' = R hat(u),   n' = -w,   m' = n x d3,   n(L) = tip force,   m(L) = 0

A module's cables are anchored at both of its ends; below it they run in housings that
carry their pull, so weight and tip force alone set n and m. Inside, the cable at r_i
with tension T_i lies along v_i = e3 + u x r_i and carries its share of the moment
(Rucker and Webster 2011, with housings for the cables of higher modules):

    diag(EI, EI, GJ) u = R^T m - sum_i T_i r_i x v_i / |v_i|

Without twist v_i is along e3 and the sum is the constant moment that bends the module
towards the cable. With twist the cables wind round the center line and resist it by
about sum_i T_i |r_i|^2, which adds to GJ.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import root

from s2c2a.arm.spec import ArmSpec, Module
from s2c2a.errors import ActionError, SimulationError
from s2c2a.spaces import States

_GRAVITY = 9.81  # m/s^2
_NO_FORCE = np.zeros(3)
# grid steps per module while the load grows; the full grid only polishes the last guess
_GUESS_STEPS = 10
_LOAD_STRIDE = 1 / 8
_MIN_STRIDE = 1e-2
_TWIST_SWEEPS = 3  # each shrinks the error by about (twist times cable radius)^2

# columns of a cross-section, shape (batch, 3, 5)
_POSITION = 0
_FRAME = slice(1, 4)
_AXIS = 3
_MOMENT = 4


@dataclass(frozen=True)
class _Segment:
    """One module with loads, levers and tensions.

    Shapes: end force (3,) [N], weight (3,) [N/m], levers (cables, 2) [m], tensions
    (cables,) [N].
    """

    module: Module
    end_force: np.ndarray
    weight: np.ndarray
    levers: np.ndarray
    tensions: np.ndarray


def rod_shape(
    arm: ArmSpec,
    tensions: Float[np.ndarray, "modules cables"],
    tip_force: Float[np.ndarray, "3"] = _NO_FORCE,
    steps_per_module: int = 100,
) -> States:
    """States of the arm at rest, by shooting on the base moment as all loads increase.

    The equilibrium is the one that grows out of the straight arm; it need not be stable
    (a standing arm may buckle). Shooting loses about 0.4 sqrt(|n| L^2 / EI) digits to a
    force n along the arm: meters of a soft hanging arm fail.

    Args:
        arm: modules, their stiffness, mass and cables, and the direction of gravity.
        tensions: cable tensions [N], never negative.
        tip_force: force on the tip [N], base frame.
        steps_per_module: Runge-Kutta steps along each module, at least 1.

    Returns:
        End position [m] and end axis of every module, base frame, shape (modules, 6).

    Raises:
        ActionError: tensions or tip force have the wrong shape or are not finite, or a
            tension is negative.
        SimulationError: no equilibrium was found.
    """
    tensions = _finite("tensions", tensions, (arm.module_count, arm.cable_count))
    tip_force = _finite("tip_force", tip_force, (3,))
    if np.any(tensions < 0):
        raise ActionError(
            f"tensions reach {tensions.min()} N but cables only pull; give 0 N or more"
        )
    segments = _segments(arm, tensions, tip_force)
    moment = _base_moment(segments, steps_per_module)
    ends = _module_ends(segments, moment[None], steps_per_module)
    return np.array(
        [np.concatenate([end[0, :, _POSITION], end[0, :, _AXIS]]) for end in ends]
    )


def _finite(name: str, values, shape: tuple[int, ...]) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    if values.shape != shape or not np.all(np.isfinite(values)):
        raise ActionError(
            f"{name} is {values.tolist()}; give finite numbers [N] of shape {shape}"
        )
    return values


def _segments(
    arm: ArmSpec, tensions: np.ndarray, tip_force: np.ndarray
) -> list[_Segment]:
    """The modules, base first, each with the force of the arm beyond it."""
    gravity = _GRAVITY * np.array(arm.gravity_direction)
    segments = []
    force = tip_force
    for module, pulls in zip(reversed(arm.modules), reversed(tensions), strict=True):
        segments.append(
            _Segment(
                module,
                force,
                gravity * module.mass / module.length,
                _levers(module),
                pulls,
            )
        )
        force = force + gravity * module.mass
    return segments[::-1]


def _levers(module: Module) -> np.ndarray:
    """First two components of r_i x e3 [m]; the third is zero."""
    angles = np.deg2rad(module.cable_angles_deg)
    return module.cable_radius * np.stack([np.sin(angles), -np.cos(angles)], axis=-1)


def _scaled(segments: list[_Segment], share: float) -> list[_Segment]:
    """The same modules under a share of every load."""
    return [
        _Segment(
            part.module,
            share * part.end_force,
            share * part.weight,
            part.levers,
            share * part.tensions,
        )
        for part in segments
    ]


def _base_moment(segments: list[_Segment], steps: int) -> np.ndarray:
    """Moment at the base [N m], shape (3,), by continuation with adaptive steps."""
    moment = np.zeros(3)
    share = 0.0
    stride = _LOAD_STRIDE
    while share < 1:
        target = min(share + stride, 1.0)
        found = _shoot(_scaled(segments, target), moment, _GUESS_STEPS)
        if found is not None:
            moment = found
            share = target
        else:
            stride = _smaller(stride, share)
    found = _shoot(segments, moment, steps)
    if found is None:
        raise SimulationError(
            f"the rod is not solved on {steps} steps per module; give more steps",
            step=0,
        )
    return found


def _smaller(stride: float, share: float) -> float:
    if stride < _MIN_STRIDE:
        raise SimulationError(
            f"no equilibrium found beyond {share:.1%} of the load; "
            "reduce the load, or make the arm shorter or stiffer",
            step=0,
        )
    return stride / 2


def _shoot(
    segments: list[_Segment], guess: np.ndarray, steps: int
) -> np.ndarray | None:
    """Base moment [N m] with zero moment at the tip, or None if the search fails."""
    scale = segments[0].module.bending_stiffness / sum(
        part.module.length for part in segments
    )
    offsets = 1e-7 * np.vstack([np.zeros(3), np.eye(3)])

    def tip_moment(moment):
        tips = (
            _module_ends(segments, scale * (moment + offsets), steps)[-1][:, :, _MOMENT]
            / scale
        )
        return tips[0], (tips[1:] - tips[0]).T / 1e-7

    with np.errstate(over="ignore", invalid="ignore"):
        found = root(tip_moment, guess / scale, jac=True, tol=1e-12)
    return scale * found.x if np.linalg.norm(found.fun) < 1e-8 else None


def _module_ends(
    segments: list[_Segment], moments: np.ndarray, steps: int
) -> list[np.ndarray]:
    """Cross-sections (batch, 3, 5) at module ends for base moments (batch, 3) [N m]."""
    section = np.zeros((len(moments), 3, 5))
    section[:, :, _FRAME] = np.eye(3)
    section[:, :, _MOMENT] = moments
    ends = []
    for segment in segments:
        section = _runge_kutta(segment, section, steps)
        ends.append(section)
    return ends


def _runge_kutta(segment: _Segment, section: np.ndarray, steps: int) -> np.ndarray:
    """Classical fourth order, from the base of a module to its end."""
    h = segment.module.length / steps
    for to_end in np.arange(steps, 0, -1) * h:
        first = _slope(segment, to_end, section)
        second = _slope(segment, to_end - h / 2, section + h / 2 * first)
        third = _slope(segment, to_end - h / 2, section + h / 2 * second)
        fourth = _slope(segment, to_end - h, section + h * third)
        section = section + h / 6 * (first + 2 * second + 2 * third + fourth)
    return section


def _slope(segment: _Segment, to_end: float, section: np.ndarray) -> np.ndarray:
    """Derivative of a cross-section along s, `to_end` meters before the module end."""
    force = segment.end_force + segment.weight * to_end
    frame = section[:, :, _FRAME]
    axis = section[:, :, _AXIS]
    moment = section[:, :, _MOMENT]
    slope = np.empty_like(section)
    slope[:, :, _POSITION] = axis
    slope[:, :, _FRAME] = frame @ _hat(
        _curvature(segment, (moment[:, None] @ frame)[:, 0])
    )
    slope[:, :, _MOMENT] = axis @ _hat(force).T
    return slope


def _curvature(segment: _Segment, moment: np.ndarray) -> np.ndarray:
    """Curvature u [1/m] for a moment [N m], both (batch, 3), cross-section frame."""
    module = segment.module
    levers = segment.levers
    tensions = segment.tensions
    curvature = np.zeros_like(moment)
    straightness = np.ones((len(moment), len(tensions)))  # e3 component of v_i / |v_i|
    for _ in range(_TWIST_SWEEPS):
        curvature[:, :2] = (
            moment[:, :2] - (tensions * straightness) @ levers
        ) / module.bending_stiffness
        along = 1 + curvature[:, :2] @ levers.T  # e3 component of v_i
        stretch = np.hypot(along, module.cable_radius * curvature[:, 2:])  # |v_i|
        winding = module.cable_radius**2 * (tensions / stretch).sum(axis=-1)
        curvature[:, 2] = moment[:, 2] / (module.gj + winding)
        straightness = along / np.hypot(along, module.cable_radius * curvature[:, 2:])
    return curvature


def _hat(vector: np.ndarray) -> np.ndarray:
    """The matrix (..., 3, 3) of the cross product with a vector (..., 3)."""
    matrix = np.zeros((*vector.shape, 3))
    matrix[..., 2, 1] = vector[..., 0]
    matrix[..., 0, 2] = vector[..., 1]
    matrix[..., 1, 0] = vector[..., 2]
    return matrix - np.swapaxes(matrix, -1, -2)
