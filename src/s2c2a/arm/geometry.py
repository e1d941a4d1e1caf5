"""Numbers that follow from an arm's description, as arrays over its modules."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from s2c2a.arm.spec import ArmSpec


def largest_gap_deg(angles_deg) -> float:
    """Largest angle between neighbouring cables [deg]."""
    around = np.sort(np.mod(angles_deg, 360.0))
    return float(np.max(np.diff(np.append(around, around[0] + 360.0))))


def cable_matrix(angles: Float[np.ndarray, "*modules cables"]) -> Float[np.ndarray, "*modules cables 2"]:
    """B with rows -(cos b_i, sin b_i): cable displacements are r B b for a bend b [rad] at cable radius r."""
    return -np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def balanced_pull(matrix: Float[np.ndarray, "cables 2"]) -> Float[np.ndarray, " cables"]:
    """Positive tensions of mean one that do not bend the module; all ones where the cables are evenly spread.

    They are t_i = exp(B_i q), where q minimises their sum: its gradient B^T t is then zero. The minimum exists for
    cables that can bend every way, and damped Newton steps find it.
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


@dataclass(frozen=True)
class ArmGeometry:
    """Arrays over the modules of one arm, SI units.

    An action is `action_neutral + action_scale * B v`, where v (|v| <= 1) is the share of the full bend in the
    module's two bend directions: the same words for displacement and tension.

    Attributes:
        lengths: module lengths [m], shape (modules,).
        cable_radii: distance of cables from the centre line [m], shape (modules,).
        cable_matrices: B, shape (modules, cables, 2).
        bend_matrices: pseudo-inverse of B, shape (modules, 2, cables).
        bend_limits: largest bend asked for [rad], shape (modules,).
        pretensions: tensions at rest [N], in balance within each module, shape (modules, cables).
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
    pretensions: np.ndarray
    action_neutral: np.ndarray
    action_scale: np.ndarray
    action_low: np.ndarray
    action_high: np.ndarray

    @classmethod
    def of(cls, arm: "ArmSpec") -> "ArmGeometry":
        """Derive the arrays from a description."""
        matrices = cable_matrix(np.deg2rad([module.cable_angles_deg for module in arm.modules]))
        radii = np.array([module.cable_radius for module in arm.modules])
        bend_limits = np.deg2rad([module.bend_limit_deg for module in arm.modules])
        pull = np.array([balanced_pull(matrix) for matrix in matrices])
        pretensions = np.array([module.pretension for module in arm.modules])[:, None] * pull
        neutral, scale = _action_map(arm, pretensions, radii * bend_limits)
        reach = np.abs(scale)[:, None]
        low = np.maximum(neutral - reach, 0.0) if arm.actuation == "tension" else neutral - reach
        return cls(
            lengths=np.array([module.length for module in arm.modules]),
            cable_radii=radii,
            cable_matrices=matrices,
            bend_matrices=np.linalg.pinv(matrices),
            bend_limits=bend_limits,
            pretensions=pretensions,
            action_neutral=neutral,
            action_scale=scale,
            action_low=low,
            action_high=neutral + reach,
        )


def _action_map(
    arm: "ArmSpec", pretensions: np.ndarray, full_displacement: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Neutral action and scale: a displacement shortens, a tension grows, towards the bend."""
    if arm.actuation == "displacement":
        return np.zeros_like(pretensions), full_displacement
    return pretensions, -np.array([module.tension_range for module in arm.modules])
