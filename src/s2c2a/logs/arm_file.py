"""Arm file of an identified arm, with the uncertainty of each number as a comment."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import tomli_w
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from s2c2a.arm import ArmSpec, arm_from_toml
from s2c2a.arm.geometry import per_cable
from s2c2a.logs.assignment import can_bend
from s2c2a.logs.cable_model import CableParameters
from s2c2a.logs.cable_search import Assignment
from s2c2a.logs.command_range import Commands, range_lines, rate_lines
from s2c2a.logs.errors import LogError
from s2c2a.logs.log_map import KnownArm, LogMap
from s2c2a.logs.model_fit import CableFit
from s2c2a.logs.priors import prior_std
from s2c2a.logs.stated_values import UNSEEN

MARGIN_DEG = 5.0  # of the bend limit above the largest bend in the log
MAX_BEND_DEG = 170.0
MAX_ANGLE_ERROR_DEG = 60.0
MIN_RADIUS = 0.0015  # m
MAX_RADIUS = 0.3  # m
DEFAULT_RADIUS = 0.01  # m
CHAMBER_AREA = (1e-8, 0.1)  # m2, the range of arm files


@dataclass(frozen=True)
class CableLayout:
    """Drives of the arm's cables.

    Where a module has fewer cables than others, the rest of its row is padding.

    Attributes:
        present: which entries are cables, shape (modules, cables).
        drive: index of the drive on each cable, shape (modules, cables), sorted by
            angle within a module.
        factor: displacement [m], positive where the cable lengthens, tension [N], or
            pressure [Pa], per unit of the column, shape (modules, cables); 0 of padding.
        angles_deg: angles of the cables, shape (modules, cables).
        radii: cable radii [m], shape (modules,).
        gains: gain of each cable over the mean of its module, shape (modules, cables).
        turn: rotation about z from the identified base frame to that of the arm [rad].
    """

    present: np.ndarray
    drive: np.ndarray
    factor: np.ndarray
    angles_deg: np.ndarray
    radii: np.ndarray
    gains: np.ndarray
    turn: float = 0.0

    def cables(
        self, columns: Float[np.ndarray, "rows drives"]
    ) -> Float[np.ndarray, "rows modules cables"]:
        """Actions of the cables [m, N or Pa], from the drives' columns."""
        return columns[:, self.drive] * self.factor


def build_layout(
    fit: CableFit,
    assignment: Assignment,
    log_map: LogMap,
) -> CableLayout:
    """Sort cables by module and angle; radii follow from the mean gain of a module.

    Raises:
        LogError: the cables of a module cannot bend it.
    """
    wiring = fit.wiring
    parameters = fit.parameters
    modules = log_map.arm.modules
    angles = np.rad2deg(parameters.angles[wiring.drive] + wiring.turn) % 360.0
    owners = assignment.modules[wiring.drive]
    counts = np.bincount(owners, minlength=modules)
    for module in np.unique(owners):
        is_own = owners == module
        if not can_bend(angles[is_own]):
            raise LogError(
                f"the cables of module {module + 1} would be at "
                f"{angles[is_own].round().tolist()} deg, where they cannot bend it; a "
                "module needs two opposed cables, or more without a gap of half a turn"
            )
        if counts[module] == 2:
            angles[is_own] = _opposed(angles[is_own])
    present = np.arange(counts.max()) < counts[:, None]
    # sorted by module, then by angle
    order = np.zeros(present.shape, int)
    order[present] = np.lexsort((angles, owners))
    every = parameters.gains[wiring.drive]
    gains = np.where(present, every[order], 0.0)
    mean = gains.sum(axis=1) / np.maximum(counts, 1)
    gains = np.exp(gains - mean[:, None])
    mean = np.exp(parameters.gain + mean)
    unit = log_map.drives[0].unit
    radius = log_map.arm.cable_radius
    if radius or log_map.actuation != "displacement":
        radii = np.full(modules, radius or DEFAULT_RADIUS)
    else:
        radii = np.clip(1 / mean, MIN_RADIUS, MAX_RADIUS)
    factor = -wiring.sign[order]
    if log_map.actuation == "tension":
        factor = -factor
    if unit == "free":
        factor = factor * gains * (mean * radii)[:, None]
    return CableLayout(
        present=present,
        drive=wiring.drive[order],
        factor=present * factor,
        angles_deg=present * angles[order],
        radii=radii,
        gains=gains,
    )


def _opposed(angles_deg: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
    """Opposed angles nearest to those of two cables [deg]."""
    first, second = np.exp(1j * np.deg2rad(angles_deg))
    middle = np.angle(first - second)
    opposed = np.rad2deg([middle, middle + np.pi])
    return opposed % 360.0


def match_layout(
    layout: CableLayout,
    arm: ArmSpec,
    may_turn: bool,
) -> CableLayout:
    """Reorder a layout to the cables of a stated arm.

    Args:
        layout: identified layout.
        arm: stated arm.
        may_turn: whether the base frame may be turned about z to fit the angles; false
            where the map states x.

    Raises:
        LogError: the arm has other numbers of modules or cables, or other angles.
    """
    angles = per_cable(arm, "cable_angles_deg")
    if angles.shape != layout.angles_deg.shape:
        raise LogError(
            f"'{arm.name}' has (modules, cables) {angles.shape}; "
            f"the map describes {layout.angles_deg.shape}"
        )
    turns = np.zeros(1)
    if may_turn:
        turns = (angles[0, 0] - layout.angles_deg[0]) % 360.0
    matches = [_match_cables(layout.angles_deg + turn, angles) for turn in turns]
    best = int(np.argmin([errors.var() for _, errors in matches]))
    order, errors = matches[best]
    offset = errors.mean() if may_turn else 0.0
    worst = float(np.abs(errors - offset).max())
    if worst > MAX_ANGLE_ERROR_DEG:
        raise LogError(
            f"cables of '{arm.name}' are up to {worst:.0f} deg from the identified "
            "ones; check its angles"
        )
    names = ("drive", "factor", "gains", "angles_deg")
    columns = {
        name: np.take_along_axis(getattr(layout, name), order, 1) for name in names
    }
    return replace(layout, **columns, turn=float(np.deg2rad(turns[best] - offset)))


def _match_cables(
    identified: np.ndarray, stated: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Identified cable nearest to each stated one, and the errors [deg]."""
    turns = np.deg2rad(stated[:, :, None] - identified[:, None, :])
    distance = 1 - np.cos(turns)
    order = np.array([linear_sum_assignment(module)[1] for module in distance])
    errors = np.take_along_axis(identified, order, 1) - stated
    return order, (errors + 180.0) % 360.0 - 180.0


def format_arm(
    fit: CableFit,
    assignment: Assignment,
    layout: CableLayout,
    log_map: LogMap,
    bends: Float[np.ndarray, "rows modules 2"],
    commands: Commands,
    cables: Float[np.ndarray, "rows modules cables"],
    residual: float,
) -> str:
    """Text of the arm file: TOML with standard deviations as comments.

    Args:
        fit: fitted cable model.
        assignment: modules and signs of the motors.
        layout: drives of the arm's cables.
        log_map: the map.
        bends: bends of the model [rad].
        commands: actions of the cables [m, N or Pa] in each segment.
        cables: the same while each row was measured, of all segments.
        residual: rms distance of the model's ends from the measured ones [m].
    """
    arm = log_map.arm
    source = f" ({log_map.source.name})" if log_map.source.name else ""
    head = [
        toml_comment(
            f"Identified from a log{source}: the ends of the model are "
            f"{1e3 * residual:.1f} mm (rms) from the measured ones."
        ),
        "# +- is one standard deviation: the scatter of stretches of the log, and the "
        "model error.",
        "# A guess is neither stated nor identified.",
        f"name = {quote(arm.name)}",
        f"description = {quote(arm.description or 'Identified from a log.')}",
        f"actuation = {quote(log_map.actuation)}",
        f"coupled_cables = {str(assignment.coupled).lower()}",
        f"gravity_direction = {[float(value) for value in arm.gravity_direction]}"
        f"  # {_stated_or_guess(arm, 'gravity_direction')}",
        f"control_rate = {float(arm.control_rate)}",
    ]
    limits = [float(arm.bend_limit_deg or 0.0)] * arm.modules
    if arm.bend_limit_deg is None:
        # larger bends are outliers
        largest = np.quantile(np.linalg.norm(bends, axis=-1), 0.995, axis=0)
        limits_deg = np.rad2deg(largest) + MARGIN_DEG
        limits = np.clip(limits_deg, 1.0, MAX_BEND_DEG).round(1).tolist()
    every = np.concatenate([*commands, cables])
    modules: list[str] = []
    for module, limit in enumerate(limits):
        own = every[:, module, layout.present[module]]
        full_bend = layout.radii[module] * np.deg2rad(limit)
        modules += _module_lines(module, fit, layout, log_map)
        # properties that a log does not show
        for key in ("mass", "bending_stiffness"):
            origin = _stated_or_guess(arm, key)
            modules.append(f"{key} = {float(getattr(arm, key))}  # {origin}")
        origin = "stated"
        if arm.bend_limit_deg is None:
            origin = f"{MARGIN_DEG:.0f} above the largest in the log"
        modules.append(f"bend_limit_deg = {limit}  # {origin}")
        if log_map.actuation == "pressure":
            # the area that bends a module of its stiffness as identified
            rigidity = arm.bending_stiffness / np.exp(fit.parameters.lengths[module])
            bend_per_pascal = np.exp(fit.parameters.gain - fit.parameters.stiffness)
            area = bend_per_pascal * rigidity / layout.radii[module]
            area = np.clip(area, *CHAMBER_AREA)
            remark = "from the bends, by stiffness and radius above"
            modules.append(f"chamber_area = {area:.3g}  # {remark}")
        modules += range_lines(own, log_map.actuation, full_bend)
    draft = arm_from_toml("\n".join([*head, *modules]), "the identified arm")
    rates = rate_lines(draft, commands, moving=log_map.rows.kind == "timed")
    return "\n".join([*head, *rates, *modules]) + "\n"


def quote(text: str) -> str:
    """TOML string."""
    return tomli_w.dumps({"text": text}).removeprefix("text = ").strip()


def _module_lines(
    module: int, fit: CableFit, layout: CableLayout, log_map: LogMap
) -> list[str]:
    arm = log_map.arm
    present = layout.present[module]
    drives = layout.drive[module][present]
    length = float(np.exp(fit.parameters.lengths[module]))
    radius = layout.radii[module]
    std = fit.std or CableParameters(
        *(np.full_like(value, np.nan) for value in fit.parameters)
    )
    count = max(len(drives), 1)
    drive_variance = np.sum(std.gains[drives] ** 2) / count**2
    gain_std = np.sqrt(std.gain**2 + drive_variance)
    names = ", ".join(log_map.drives[drive].name for drive in drives)
    gains = [
        f"{gain:.3f} +- {error:.3f}"
        for gain, error in zip(
            layout.gains[module][present], std.gains[drives], strict=True
        )
    ]
    length_origin = _length_origin(module, std.lengths[module], length, log_map)
    radius_origin = _origin(radius * gain_std, arm.cable_radius)
    angles = _join(layout.angles_deg[module][present], 2)
    angle_std = _join(np.rad2deg(std.angles[drives]), 1)
    lines = [
        "",
        "[[modules]]",
        f"length = {length:.5f}  # {length_origin}",
        f"cable_radius = {radius:.5f}  # {radius_origin}",
        f"cable_angles_deg = [{angles}]",
    ]
    if not len(drives):
        return [*lines, "# passive: no drive of the map ends here"]
    return [
        *lines,
        f"# angles +- {angle_std} deg",
        toml_comment(f"driven by {names}"),
        f"# gains over their mean: {', '.join(gains)}",
    ]


def _join(values: Iterable[float], digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _stated_or_guess(arm: KnownArm, key: str) -> str:
    return "stated" if key in arm.model_fields_set else "a guess"


def _length_origin(module: int, std: float, length: float, log_map: LogMap) -> str:
    """Origin of a length, without a deviation where the log does not determine it.

    Where an end of the module is unknown, errors of the model move the length by more
    than the scatter of the log shows, and equally in every stretch.
    """
    arm = log_map.arm
    if arm.modules == 1 and arm.length is not None:
        return "stated"
    ends = {-1, *log_map.end_modules}
    is_unseen = std > UNSEEN * prior_std(log_map)["lengths"]
    if arm.lengths is None and (is_unseen or not {module - 1, module} <= ends):
        return "not determined by the measured ends; state it"
    return _origin(length * std, arm.lengths)


def _origin(std: float, stated: object) -> str:
    return f"+- {std:.5f}" if stated is None else "stated"


def toml_comment(text: str) -> str:
    """One line of TOML that is a comment, whatever the text holds, such as line feeds."""
    printable = (char if char.isprintable() else " " for char in text)
    return f"# {''.join(printable)}"
