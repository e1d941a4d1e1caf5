"""Geometry of an arm: arrays over its modules, and its center line."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from s2c2a.arm.spec import ArmSpec, counts_of
from s2c2a.spaces import AXIS, CENTER_LINE_POINTS, POSITION, Actions, Bends


def per_module(arm: ArmSpec, key: str) -> np.ndarray:
    """Return the values of a key such as `cable.backlash`, shape (modules, ...)."""
    return np.array([attrgetter(key)(module) for module in arm.modules])


def per_cable(arm: ArmSpec, key: str) -> Float[np.ndarray, "modules cables"]:
    """Return the values of a key that has one number a module or one a cable.

    They are zero beyond the cables of a module.
    """
    values = np.zeros((arm.module_count, arm.cable_count))
    for row, count, module in zip(
        values, counts_of(arm.modules), arm.modules, strict=True
    ):
        row[:count] = attrgetter(key)(module)
    return values


def per_unit_of_pull(arm: ArmSpec) -> Float[np.ndarray, " modules"]:
    """Return the pull of a unit of action of a force arm [N]; chambers push."""
    if arm.actuation == "pressure":
        return -per_module(arm, "chamber_area")
    return np.ones(arm.module_count)


def cables_present(arm: ArmSpec) -> Bool[np.ndarray, "modules cables"]:
    """Return where arrays over cables have one, and no padding."""
    counts = np.array(counts_of(arm.modules))
    return np.arange(arm.cable_count) < counts[:, None]


def directions_at(angles: Float[np.ndarray, "*all"]) -> Float[np.ndarray, "*all 2"]:
    """Return vectors of length one in a plane, at angles from x to y [rad]."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def cable_matrix(
    angles: Float[np.ndarray, "*modules cables"],
) -> Float[np.ndarray, "*modules cables 2"]:
    """Return B with rows -(cos b_i, sin b_i) for cables at angles b_i.

    Cable displacements are r B b for a bend b [rad] at cable radius r.
    """
    return -directions_at(angles)


def balanced_pull(
    matrix: Float[np.ndarray, "cables 2"],
) -> Float[np.ndarray, " cables"]:
    """Return positive tensions with mean one that do not bend the module.

    They are all one for evenly spread cables. In general t_i = exp(B_i q), where q
    minimizes their sum, so that its gradient B^T t is zero. The minimum exists for
    cables that can bend the module in every direction, or both ways in one plane;
    damped Newton steps find it. Rows of zeros are no cables, and have no tension.
    """
    is_cable = matrix.any(axis=-1)
    if not is_cable.any():
        return np.zeros(len(matrix))
    point = np.zeros(2)
    for _ in range(200):
        tensions = is_cable * np.exp(matrix @ point)
        gradient = matrix.T @ tensions
        if np.linalg.norm(gradient) < 1e-14 * tensions.sum():
            break
        step = np.linalg.pinv((matrix.T * tensions) @ matrix) @ gradient
        point = point - step / max(1.0, float(np.linalg.norm(step)))
    return tensions / tensions[is_cable].mean()


def raised(
    actions: Float[Any, "*batch modules cables"],
    low: Float[Any, "modules cables"],
    balance: Float[Any, "modules cables"] | None,
) -> Float[Any, "*batch modules cables"]:
    """Add the least common part to actions with which none is below its limit.

    Args:
        actions: NumPy, or JAX and then differentiable.
        low: least actions.
        balance: common part that does not bend the modules; None adds nothing.
    """
    if balance is None:
        return actions
    xp = actions.__array_namespace__()
    is_cable = balance > 0.0
    parts = xp.where(is_cable, balance, 1.0)
    missing = xp.where(is_cable, (low - actions) / parts, 0.0)
    largest = xp.max(missing, axis=-1, keepdims=True)
    return actions + xp.maximum(largest, 0.0) * balance


# Share of the bend limit that plans may use by encoders, which do not see lost motion.
_PLANNED_SHARE = 1.5
DEFAULT_ACCELERATION_RATIO = 1.5
"""Acceleration limit, in step limits, of an arm file that states none: as fast as
plans of the paper's recipe reverse."""


@dataclass(frozen=True)
class ArmGeometry:
    """Arrays over the modules of one arm, SI units.

    An action is `action_neutral + action_scale * B v`, where v (|v| <= 1) is the share
    of the full bend in the module's two bend directions, both for displacement and for
    tension. If the cable travel exceeds that of a full bend, v is the share of the
    travel.

    Attributes:
        lengths: module lengths [m], shape (modules,).
        cable_radii: distance of cables from the center line [m], shape (modules,).
        cable_matrices: B, shape (modules, cables, 2).
        bend_matrices: pseudo-inverse of B, shape (modules, 2, cables).
        steerable: projections of bends onto those that the cables of a module command,
            shape (modules, 2, 2); None where they command all.
        bend_limits: largest true bend [rad], shape (modules,).
        action_bends: bend at the limit of the actions without losses [rad], shape
            (modules,).
        planned_bends: largest sensed bend of a plan [rad], shape (modules,). Encoders
            do not see lost motion, so it exceeds the bend limit by up to a half if the
            cable travel allows it.
        step_limit: largest change of a module's bend in one control step [rad]; the
            planner and the command limits share it.
        acceleration_limit: largest difference of two such changes in a row [rad].
        cable_springs: bending stiffness of taut cables with fixed motors [N m/rad],
            zero for tension arms, shape (modules,).
        pretensions: tensions at rest [N], in balance within each module, shape
            (modules, cables).
        balance: common part of pressures that does not bend a module and keeps them
            above zero (`raised`), shape (modules, cables); None for cables.
        action_neutral: action at rest [m or N], shape (modules, cables).
        action_scale: action per unit of B v [m or N], shape (modules,).
        action_low: least action allowed [m or N], shape (modules, cables).
        action_high: largest action allowed [m or N], shape (modules, cables).
    """

    lengths: np.ndarray
    cable_radii: np.ndarray
    cable_matrices: np.ndarray
    bend_matrices: np.ndarray
    steerable: np.ndarray | None
    bend_limits: np.ndarray
    action_bends: np.ndarray
    planned_bends: np.ndarray
    step_limit: float
    acceleration_limit: float
    cable_springs: np.ndarray
    pretensions: np.ndarray
    balance: np.ndarray | None
    action_neutral: np.ndarray
    action_scale: np.ndarray
    action_low: np.ndarray
    action_high: np.ndarray

    @classmethod
    def of(cls, arm: ArmSpec) -> "ArmGeometry":
        """Compute the arrays from a description."""
        present = cables_present(arm)
        angles = per_cable(arm, "cable_angles_deg")
        matrices = present[..., None] * cable_matrix(np.deg2rad(angles))
        radii = per_module(arm, "cable_radius")
        bend_limits = np.deg2rad(per_module(arm, "bend_limit_deg"))
        bends = bend_limits.copy()
        for number, module in enumerate(arm.modules):
            if module.cable.travel is not None:
                bends[number] = module.cable.travel / radii[number]
        balance = np.array([balanced_pull(matrix) for matrix in matrices])
        pretensions = per_module(arm, "pretension")[:, None] * balance
        counts = present.sum(axis=-1)
        springs = per_module(arm, "cable.stiffness") * radii**2 * counts / 2.0
        neutral = np.zeros_like(pretensions)
        scale = radii * bends
        if arm.actuation == "tension":  # it rises towards the bend
            neutral = pretensions
            scale = -per_module(arm, "tension_range")
        if arm.actuation == "pressure":  # it falls towards the bend
            rest = per_module(arm, "rest_pressure")
            limits = per_module(arm, "pressure_limit")
            neutral = rest[:, None] * balance
            scale = limits - neutral.max(axis=-1)
            # over the largest pressure of a raised full bend, in units of its scale
            angles = np.linspace(0.0, 2.0 * np.pi, 361)
            shares = np.stack([np.cos(angles), np.sin(angles)])
            pushes = np.einsum("mck,kd->dmc", matrices, shares)
            pressures = raised(pushes, np.zeros_like(balance), balance)
            scale = scale / np.maximum(pressures.max(axis=(0, 2)), 1.0)
        action_range = present * np.abs(scale)[:, None]
        low = neutral - action_range
        high = neutral + action_range
        if arm.actuation != "displacement":
            low = np.maximum(low, 0.0)
        if arm.actuation == "pressure":
            high = present * limits[:, None]
        planned_bends = bend_limits
        if arm.sensing == "encoders":
            planned_bends = np.minimum(bends, _PLANNED_SHARE * bend_limits)
        inverses = np.linalg.pinv(matrices)
        projectors = inverses @ matrices
        is_free = np.allclose(projectors, np.eye(2), atol=1e-9)
        default_deg = DEFAULT_ACCELERATION_RATIO * arm.step_limit_deg
        acceleration_deg = arm.acceleration_limit_deg or default_deg
        return cls(
            lengths=per_module(arm, "length"),
            cable_radii=radii,
            cable_matrices=matrices,
            bend_matrices=inverses,
            steerable=None if is_free else projectors,
            bend_limits=bend_limits,
            action_bends=bends,
            planned_bends=planned_bends,
            step_limit=float(np.deg2rad(arm.step_limit_deg)),
            acceleration_limit=float(np.deg2rad(acceleration_deg)),
            cable_springs=springs * (arm.actuation == "displacement"),
            pretensions=pretensions,
            balance=balance if arm.actuation == "pressure" else None,
            action_neutral=neutral,
            action_scale=scale,
            action_low=low,
            action_high=high,
        )

    def actions_at(self, shares: Bends) -> Actions:
        """Return the actions [m or N] for shares v of the full bend.

        Args:
            shares: v in each module's two bend directions.
        """
        directions = np.einsum("mck,...mk->...mc", self.cable_matrices, shares)
        actions = self.action_neutral + self.action_scale[:, None] * directions
        return raised(actions, self.action_low, self.balance)

    def bends_of(self, cables: Actions) -> Bends:
        """Return the bends that cables hold, which common motion does not change.

        Args:
            cables: displacements over the cable radius [rad], or shares of the actions;
                the bends have the same unit.
        """
        # einsum of NumPy or of JAX, in which exported control steps are traced
        einsum = cables.__array_namespace__().einsum
        return einsum("mkc,...mc->...mk", self.bend_matrices, cables)

    def commanded_bends(self, actions: Actions) -> Bends:
        """Return the bends of modules without losses [rad] that actions command.

        Args:
            actions: displacements [m], or tensions [N].
        """
        shares = (actions - self.action_neutral) / self.action_scale[:, None]
        return self.bends_of(shares) * self.action_bends[:, None]


def name_of_end(arm: ArmSpec, module: int) -> str:
    """Return the name of a module's end in sentences, after "the"."""
    is_tip = module == arm.module_count - 1
    return "tip" if is_tip else f"end of module {module + 1}"


def hermite_weights(
    shares: Float[np.ndarray, " points"],
) -> Float[np.ndarray, "4 points"]:
    """Return the cubic Hermite basis functions at shares from 0 to 1.

    Rows are the weights of the start, its slope, the end and its slope.
    """
    s = shares
    return np.stack(
        [2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3, s**3 - s**2]
    )


def interpolated(
    wanted: Float[np.ndarray, "*wanted"] | float,
    places: Float[np.ndarray, " places"],
    values: Float[np.ndarray, "places *shape"],
) -> Float[np.ndarray, "..."]:
    """Return values on straight lines between rising places, and the outer ones beyond."""
    rows = values.reshape(len(values), -1)
    columns = [np.interp(wanted, places, column) for column in rows.T]
    return np.stack(columns, axis=-1).reshape(*np.shape(wanted), *values.shape[1:])


def body_radii(
    lengths: Sequence[float], radii: Sequence[float], points: int
) -> Float[np.ndarray, " points"]:
    """Return the radius of the body around each point of the center line [m].

    Near the base it is at most half of the way there: what the arm is mounted on is no
    obstacle to it.

    Args:
        lengths: of the modules [m].
        radii: of the modules [m].
        points: number of points of each module.
    """
    starts = np.cumsum(lengths) - lengths
    shares = np.arange(1, points + 1) / points
    from_base = starts[:, None] + np.multiply.outer(lengths, shares)
    smallest = np.minimum(np.reshape(radii, (-1, 1)), from_base / 2.0)
    return smallest.reshape(-1).astype(np.float32)


def center_line(
    states: Float[Any, "*batch modules 6"],
    lengths: Float[Any, " modules"],
    points: int = CENTER_LINE_POINTS,
) -> Float[Any, "*batch points 3"]:
    """Return points along the arm from base to tip [m], base frame.

    The last point of each module is its end. A module is the cubic Hermite curve
    between the positions and axes of its ends, with the module's length as speed. This
    is within a millimeter of an arc of 0.2 m and 50 deg, and exact for a straight
    module.

    Args:
        states: end position [m] and axis of every module, base frame; NumPy, or JAX and
            then differentiable.
        lengths: lengths of the modules [m], of the same library.
        points: number of points of each module.
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
