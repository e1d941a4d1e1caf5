"""What follows from an arm's description: numbers as arrays over its modules, and its center line."""

from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from jaxtyping import Float

from s2c2a.arm.spec import ArmSpec
from s2c2a.spaces import AXIS, CENTER_LINE_POINTS, POSITION


def per_module(arm: ArmSpec, key: str) -> np.ndarray:
    """What an arm file says of every module under a key such as `cable.backlash`, shape (modules, ...)."""
    return np.array([attrgetter(key)(module) for module in arm.modules])


def per_cable(arm: ArmSpec, key: str) -> Float[np.ndarray, "modules cables"]:
    """The same of every cable, where a module says one number for all of its own, or one each."""
    values = map(attrgetter(key), arm.modules)
    return np.array(
        [np.broadcast_to(value, arm.cable_count) for value in values], dtype=float
    )


def cable_matrix(
    angles: Float[np.ndarray, "*modules cables"],
) -> Float[np.ndarray, "*modules cables 2"]:
    """B with rows -(cos b_i, sin b_i): cable displacements are r B b for a bend b [rad] at cable radius r."""
    return -np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def balanced_pull(
    matrix: Float[np.ndarray, "cables 2"],
) -> Float[np.ndarray, " cables"]:
    """Positive tensions of mean one that do not bend the module; all ones where the cables are evenly spread.

    They are t_i = exp(B_i q), where q minimizes their sum: its gradient B^T t is then
    zero. The minimum exists for cables that can bend every way, and damped Newton steps
    find it.
    """
    point = np.zeros(2)
    for _ in range(200):
        pull = np.exp(matrix @ point)
        gradient = matrix.T @ pull
        if np.linalg.norm(gradient) < 1e-14 * pull.sum():
            break
        step = np.linalg.solve((matrix.T * pull) @ matrix, gradient)
        point = point - step / max(1.0, float(np.linalg.norm(step)))
    return pull / pull.mean()


# of the bend limit: what a plan may ask for where motion is lost on the way
MADE_UP = 1.5


@dataclass(frozen=True)
class ArmGeometry:
    """Arrays over the modules of one arm, SI units.

    An action is `action_neutral + action_scale * B v`, where v (|v| <= 1) is the share
    of the full bend in the module's two bend directions: the same words for
    displacement and tension. Where cables travel further than a full bend takes, v is
    the share of that travel.

    Attributes:
        lengths: module lengths [m], shape (modules,).
        cable_radii: distance of cables from the center line [m], shape (modules,).
        cable_matrices: B, shape (modules, cables, 2).
        bend_matrices: pseudo-inverse of B, shape (modules, 2, cables).
        bend_limits: largest bend asked for [rad], shape (modules,).
        action_bends: what the whole range of actions would bend without any loss [rad],
            shape (modules,).
        planned_bends: largest bend that a plan may have, as it is sensed: encoders do
            not see what is lost on the way, for which cables that travel further may
            make up by half the bend limit [rad], shape (modules,).
        cable_springs: what cables that hold still add to a module's stiffness against
            bending while all are taut [N m/rad], none where they give way, shape
            (modules,).
        pretensions: tensions at rest [N], in balance within each module, shape
            (modules, cables).
        action_neutral: action at rest [m or N], shape (modules, cables).
        action_scale: action per unit of B v [m or N], shape (modules,).
        action_low: least action allowed [m or N], shape (modules, cables).
        action_high: largest action allowed [m or N], shape (modules, cables).
    """

    lengths: np.ndarray
    cable_radii: np.ndarray
    cable_matrices: np.ndarray
    bend_matrices: np.ndarray
    bend_limits: np.ndarray
    action_bends: np.ndarray
    planned_bends: np.ndarray
    cable_springs: np.ndarray
    pretensions: np.ndarray
    action_neutral: np.ndarray
    action_scale: np.ndarray
    action_low: np.ndarray
    action_high: np.ndarray

    @classmethod
    def of(cls, arm: ArmSpec) -> "ArmGeometry":
        """Derive the arrays from a description."""
        matrices = cable_matrix(np.deg2rad(per_module(arm, "cable_angles_deg")))
        radii = per_module(arm, "cable_radius")
        bend_limits = np.deg2rad(per_module(arm, "bend_limit_deg"))
        travels = [module.cable.travel for module in arm.modules]
        bends = np.array(
            [
                limit if way is None else way / radius
                for limit, way, radius in zip(bend_limits, travels, radii, strict=True)
            ]
        )
        pull = np.array([balanced_pull(matrix) for matrix in matrices])
        pretensions = per_module(arm, "pretension")[:, None] * pull
        tension = arm.actuation == "tension"
        springs = per_module(arm, "cable.stiffness") * radii**2 * arm.cable_count / 2.0
        neutral = pretensions if tension else np.zeros_like(pretensions)
        # a displacement shortens, a tension grows, towards the bend
        scale = -per_module(arm, "tension_range") if tension else radii * bends
        reach = np.abs(scale)[:, None]
        return cls(
            lengths=per_module(arm, "length"),
            cable_radii=radii,
            cable_matrices=matrices,
            bend_matrices=np.linalg.pinv(matrices),
            bend_limits=bend_limits,
            action_bends=bends,
            planned_bends=np.minimum(bends, MADE_UP * bend_limits)
            if arm.sensing == "encoders"
            else bend_limits,
            cable_springs=springs * (0.0 if tension else 1.0),
            pretensions=pretensions,
            action_neutral=neutral,
            action_scale=scale,
            action_low=np.maximum(neutral - reach, 0.0) if tension else neutral - reach,
            action_high=neutral + reach,
        )

    def actions_at(
        self, shares: Float[np.ndarray, "*batch modules 2"]
    ) -> Float[np.ndarray, "*batch modules cables"]:
        """Actions [m or N] for shares v of the full bend in each module's two bend directions."""
        return self.action_neutral + self.action_scale[:, None] * np.einsum(
            "mck,...mk->...mc", self.cable_matrices, shares
        )


def hermite_weights(
    shares: Float[np.ndarray, " points"],
) -> Float[np.ndarray, "4 points"]:
    """What start, slope there, end and slope there weigh in the cubic (Hermite) at shares 0 to 1 of its way."""
    s = shares
    return np.stack(
        [2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3, s**3 - s**2]
    )


def center_line(
    states: Float[Any, "*batch modules 6"],
    lengths: Float[Any, " modules"],
    points: int = CENTER_LINE_POINTS,
) -> Float[Any, "*batch points 3"]:
    """Points along the arm from base to tip, the last of each module at its end [m], base frame.

    Between two ends runs the cubic that has their positions and axes (Hermite), its
    speed the module's length: within a millimeter of an arc of 0.2 m and 50 deg, and
    exact for a straight module.

    Args:
        states: end position [m] and axis of every module, base frame; of NumPy, or of
            JAX and then differentiable.
        lengths: of the modules [m], of the same kind.
        points: of each module.
    """
    xp = states.__array_namespace__()
    unit = np.array([0, 0, 0, 0, 0, 1], states.dtype)
    base = xp.broadcast_to(xp.asarray(unit), (*states.shape[:-2], 1, 6))
    before = xp.concat([base, states[..., :-1, :]], axis=-2)[..., None, :]
    after = states[..., None, :]
    speed = lengths[:, None, None]
    shares = np.arange(1, points + 1, dtype=states.dtype) / points
    start, slope, end, end_slope = hermite_weights(shares)[..., None]
    line = (
        start * before[..., POSITION]
        + slope * speed * before[..., AXIS]
        + end * after[..., POSITION]
        + end_slope * speed * after[..., AXIS]
    )  # (*batch, modules, points of a module, 3)
    return line.reshape(*states.shape[:-2], -1, 3)
