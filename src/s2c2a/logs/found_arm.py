"""The arm file of an arm that was found in logs, with what is uncertain beside each number."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import tomli_w
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.logs.cables import Motors
from s2c2a.logs.errors import LogError
from s2c2a.logs.fitting import Fit
from s2c2a.logs.map import KnownArm, LogMap
from s2c2a.logs.tendons import Guess

MARGIN_DEG = 5.0
MIN_STEP = 1e-3  # rad; less is no step
STEPS_DEG = (0.1, 20.0)
"""Step limits that a log can ask for: poses that were gone to at random are no reason
to go there in one step."""
MAX_OFF_DEG = 60.0


@dataclass(frozen=True)
class Layout:
    """Where each drive's column goes in the arm's cables.

    Attributes:
        drive: number of the drive on each cable, shape (modules, cables); by angle
            within a module.
        factor: displacement [m], positive where the cable gets longer, or tension [N],
            for a unit of the column.
        angles_deg: where the cables are, the same shape.
        radii: of the cables [m], shape (modules,).
        gains: of each cable over the mean of its module, shape (modules, cables).
        turn: by which the base frame of the arm is turned about z against the one that
            was found [rad].
    """

    drive: np.ndarray
    factor: np.ndarray
    angles_deg: np.ndarray
    radii: np.ndarray
    gains: np.ndarray
    turn: float = 0.0


def layout_of(fit: Fit, motors: Motors, told: LogMap) -> Layout:
    """Cables by module and angle; radii from the mean gain of a module where the unit is known.

    Raises:
        LogError: modules have different numbers of cables.
    """
    wiring = fit.wiring
    angles = np.mod(np.rad2deg(fit.guess.angles[wiring.drive] + wiring.turn), 360.0)
    owners = motors.modules[wiring.drive]
    counts = np.bincount(owners, minlength=told.arm.modules)
    if len(set(counts)) > 1 or counts[0] < 3:
        raise LogError(
            f"the modules would have {counts.tolist()} cables; each needs as many, and three at least"
        )
    order = np.array(
        [
            sorted(np.flatnonzero(owners == module), key=lambda cable: angles[cable])
            for module in range(told.arm.modules)
        ]
    )
    gains = np.exp(fit.guess.gain + fit.guess.gains)[wiring.drive][order]
    mean = np.exp(np.log(gains).mean(axis=1))
    tension, free = (told.drives[0].unit == unit for unit in ("N", "free"))
    stated = told.arm.cable_radius
    radii = (
        np.full(told.arm.modules, stated or 0.01)
        if stated or tension
        else np.clip(1 / mean, 0.0015, 0.3)
    )
    size = gains * radii[:, None] if free else np.ones_like(gains)
    way = (1.0 if tension else -1.0) * wiring.sign[order]
    return Layout(
        wiring.drive[order], way * size, angles[order], radii, gains / mean[:, None]
    )


def matched(layout: Layout, arm: ArmSpec, turned: bool) -> Layout:
    """The layout in the order of a stated arm's cables.

    Args:
        layout: as it was found.
        arm: that was stated.
        turned: whether x may be turned so that angles fit best; not where the map says
            where x is.

    Raises:
        LogError: the arm has other modules or cables, or its cables stand elsewhere.
    """
    angles = per_module(arm, "cable_angles_deg")
    if angles.shape != layout.angles_deg.shape:
        raise LogError(
            f"'{arm.name}' has (modules, cables) {angles.shape}, the map tells of {layout.angles_deg.shape}"
        )
    turns = (angles[0, 0] - layout.angles_deg[0]) % 360.0 if turned else np.zeros(1)
    orders = [_order(layout.angles_deg + turn, angles) for turn in turns]
    apart = [
        _apart(layout, turn, order, angles)
        for turn, order in zip(turns, orders, strict=True)
    ]
    best = int(np.argmin([one.var() for one in apart]))
    more = apart[best].mean() if turned else 0.0
    if (worst := float(np.abs(apart[best] - more).max())) > MAX_OFF_DEG:
        raise LogError(
            f"cables of '{arm.name}' stand up to {worst:.0f} deg from those found; check its angles"
        )
    names = ("drive", "factor", "gains", "angles_deg")
    kept = {
        name: np.take_along_axis(getattr(layout, name), orders[best], 1)
        for name in names
    }
    return replace(layout, **kept, turn=float(np.deg2rad(turns[best] - more)))


def _apart(
    layout: Layout, turn: float, order: np.ndarray, angles: np.ndarray
) -> np.ndarray:
    """How far cables are from where they shall be [deg]."""
    return (
        np.take_along_axis(layout.angles_deg + turn, order, 1) - angles + 180.0
    ) % 360.0 - 180.0


def _order(found: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Which of the cables found is nearest to each of the arm's, module by module."""
    from scipy.optimize import linear_sum_assignment

    apart = 1 - np.cos(np.deg2rad(angles[:, :, None] - found[:, None, :]))
    return np.array([linear_sum_assignment(one)[1] for one in apart])


def arm_text(
    fit: Fit,
    motors: Motors,
    layout: Layout,
    told: LogMap,
    bends: Sequence[np.ndarray],
    residual: float,
) -> str:
    """The arm file: TOML, loadable, with standard deviations as remarks.

    Args:
        fit: of the model that the cables were found with.
        motors: what that assumes.
        layout: where each drive went.
        told: the map.
        bends: of that model in each stretch of the log [rad], each of shape (rows,
            modules, 2).
        residual: rms distance of the model's ends from those seen [m].
    """
    arm = told.arm
    source = f" ({told.source.name})" if told.source.name else ""
    limits = _most_deg(np.concatenate(bends), 0.995) + MARGIN_DEG
    steps = np.concatenate([np.diff(part, axis=0) for part in bends])
    moved = np.linalg.norm(steps, axis=-1).max(axis=-1) > MIN_STEP
    step = _most_deg(steps[moved] if moved.any() else steps, 0.99).max()
    lines = [
        f"# Found in a log{source}: ends of the model are {1e3 * residual:.1f} mm (rms) from those seen.",
        "# Behind +- stands one standard deviation: how much stretches of the log disagree, and what the model leaves.",
        "# What is a guess was neither stated nor found.",
        f"name = {quoted(arm.name)}",
        f"description = {quoted(arm.description or 'Found in a log.')}",
        f"actuation = {quoted('tension' if told.drives[0].unit == 'N' else 'displacement')}",
        f"coupled_cables = {str(motors.coupled).lower()}",
        f"gravity_direction = {[float(one) for one in arm.gravity_direction]}",
        f"control_rate = {float(arm.control_rate)}",
        f"step_limit_deg = {np.clip(step, *STEPS_DEG):.1f}  # 99 of 100 steps of the log were no longer",
    ]
    modules = [
        _module_lines(module, fit, layout, told, float(limits[module]))
        for module in range(arm.modules)
    ]
    return "\n".join([*lines, *(line for module in modules for line in module)]) + "\n"


def _most_deg(
    bends: Float[np.ndarray, "rows modules 2"], share: float
) -> Float[np.ndarray, " modules"]:
    """This share of them are smaller [deg]; the rest are outliers."""
    return np.rad2deg(np.quantile(np.linalg.norm(bends, axis=-1), share, axis=0))


def quoted(text: str) -> str:
    """As TOML writes it."""
    return tomli_w.dumps({"text": text}).removeprefix("text = ").strip()


def _module_lines(
    module: int, fit: Fit, layout: Layout, told: LogMap, limit: float
) -> list[str]:
    arm = told.arm
    length = float(np.exp(fit.guess.lengths[module]))
    drives = layout.drive[module]
    off = fit.errors or Guess(*(np.full_like(part, np.nan) for part in fit.guess))
    names = [told.drives[drive].name for drive in drives]
    spread = layout.radii[module] * np.sqrt(
        off.gain**2 + np.mean(off.gains[drives] ** 2) / len(drives)
    )
    gains = zip(layout.gains[module], off.gains[drives], strict=True)
    return [
        "",
        "[[modules]]",
        f"length = {length:.5f}  # {_or_stated(length * off.lengths[module], arm.lengths)}",
        f"cable_radius = {layout.radii[module]:.5f}  # {_or_stated(spread, arm.cable_radius)}",
        f"cable_angles_deg = [{', '.join(f'{one:.2f}' for one in layout.angles_deg[module])}]",
        f"# angles +- {', '.join(f'{one:.1f}' for one in np.rad2deg(off.angles[drives]))} deg",
        f"# driven by {quoted(', '.join(names))[1:-1]}",
        f"# gains over their mean: {', '.join(f'{one:.3f} +- {error:.3f}' for one, error in gains)}",
        *_plain_lines(arm, limit),
    ]


def _plain_lines(arm: KnownArm, limit: float) -> list[str]:
    """What a log does not tell."""
    known = {
        key: "stated" if key in arm.model_fields_set else "a guess"
        for key in ("mass", "bending_stiffness")
    }
    lines = [
        f"{key} = {float(getattr(arm, key))}  # {how}" for key, how in known.items()
    ]
    if arm.bend_limit_deg is not None:
        return [*lines, f"bend_limit_deg = {float(arm.bend_limit_deg)}  # stated"]
    seen = float(np.clip(limit, 1.0, 150.0))
    return [
        *lines,
        f"bend_limit_deg = {seen:.1f}  # {MARGIN_DEG:.0f} more than was seen",
    ]


def _or_stated(spread: float, stated: object) -> str:
    return f"+- {spread:.5f}" if stated is None else "stated"
