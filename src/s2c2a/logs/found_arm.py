"""The arm file of an arm that was found in logs, with what is uncertain beside each number."""

from dataclasses import dataclass, replace

import numpy as np
import tomli_w
from jaxtyping import Float

from s2c2a.arm import ArmSpec
from s2c2a.arm.geometry import per_module
from s2c2a.logs.cables import Motors
from s2c2a.logs.errors import LogError
from s2c2a.logs.fitting import Fit
from s2c2a.logs.map import LogMap

MARGIN_DEG = 5.0


@dataclass(frozen=True)
class Layout:
    """Where each drive's column goes in the arm's cables.

    Attributes:
        drive: number of the drive on each cable, shape (modules, cables); by angle within a module.
        factor: displacement [m], positive where the cable gets longer, or tension [N], for a unit of the column.
        angles_deg: where the cables are, the same shape.
        radii: of the cables [m], shape (modules,).
        gains: of each cable over the mean of its module, shape (modules, cables).
        turn: by which the base frame of the arm is turned about z against the one that was found [rad].
    """

    drive: np.ndarray
    factor: np.ndarray
    angles_deg: np.ndarray
    radii: np.ndarray
    gains: np.ndarray
    turn: float = 0.0

    def cables(self, columns: Float[np.ndarray, "rows drives"]) -> Float[np.ndarray, "rows modules cables"]:
        """What the arm's cables do, when the drives' columns say this."""
        return columns[:, self.drive] * self.factor


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
        raise LogError(f"the modules would have {counts.tolist()} cables; each needs as many, and three at least")
    order = np.array(
        [
            sorted(np.flatnonzero(owners == module), key=lambda cable: angles[cable])
            for module in range(told.arm.modules)
        ]
    )
    gains = np.exp(fit.guess.gain + fit.guess.gains)[wiring.drive][order]
    mean = np.exp(np.log(gains).mean(axis=1))
    free = told.drives[0].unit == "free"
    tension = told.drives[0].unit == "N"
    if tension or told.arm.cable_radius is not None:
        radii = np.full(told.arm.modules, told.arm.cable_radius or 0.01)
    else:
        radii = np.clip(1 / mean, 0.0015, 0.3)
    size = (mean * radii)[:, None] if free else np.ones((len(mean), 1))
    return Layout(
        wiring.drive[order],
        (1.0 if tension else -1.0) * wiring.sign[order] * size,
        angles[order],
        radii,
        gains / mean[:, None],
    )


def matched(layout: Layout, arm: ArmSpec) -> Layout:
    """The layout in the order of a stated arm's cables, its x turned so that angles fit best.

    Raises:
        LogError: the arm has other modules or cables, or its cables stand elsewhere.
    """
    angles = per_module(arm, "cable_angles_deg")
    if angles.shape != layout.angles_deg.shape:
        raise LogError(f"'{arm.name}' has (modules, cables) {angles.shape}, the map tells of {layout.angles_deg.shape}")
    turns = (angles[0, 0] - layout.angles_deg[0]) % 360.0
    orders = [_order(layout.angles_deg + turn, angles) for turn in turns]
    apart = [
        np.take_along_axis(layout.angles_deg + turn, order, 1) - angles
        for turn, order in zip(turns, orders, strict=True)
    ]
    apart = [(one + 180.0) % 360.0 - 180.0 for one in apart]
    best = int(np.argmin([np.mean((one - one.mean()) ** 2) for one in apart]))
    rest = apart[best] - apart[best].mean()
    if np.abs(rest).max() > 60.0:
        raise LogError(
            f"cables of '{arm.name}' stand up to {np.abs(rest).max():.0f} deg from those found; check its angles"
        )
    kept = {
        name: np.take_along_axis(getattr(layout, name), orders[best], 1)
        for name in ("drive", "factor", "gains", "angles_deg")
    }
    return replace(layout, **kept, turn=float(np.deg2rad(turns[best] - apart[best].mean())))


def _order(found: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Which of the cables found is nearest to each of the arm's, module by module."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 (heavy)

    apart = 1 - np.cos(np.deg2rad(angles[:, :, None] - found[:, None, :]))
    return np.array([linear_sum_assignment(one)[1] for one in apart])


def arm_text(fit: Fit, motors: Motors, layout: Layout, told: LogMap, bends: np.ndarray, residual: float) -> str:
    """The arm file: TOML, loadable, with standard deviations as remarks."""
    arm = told.arm
    largest = np.rad2deg(np.quantile(np.linalg.norm(bends, axis=-1), 0.995, axis=0)) + MARGIN_DEG
    limits = [float(np.clip(arm.bend_limit_deg or limit, 1, 150)) for limit in largest]
    lines = [
        f"# Found in a log{f' ({told.source.name})' if told.source.name else ''}: ends of the model are {1e3 * residual:.1f} mm (rms) from those seen.",
        "# Behind +- stands one standard deviation; what is marked as a guess was neither stated nor found.",
        f'name = "{arm.name}"',
        f"description = {_quoted(arm.description or 'Found in a log.')}",
        f'actuation = "{"tension" if told.drives[0].unit == "N" else "displacement"}"',
        f"coupled_cables = {str(motors.coupled).lower()}",
        f"gravity_direction = [{', '.join(f'{float(one)}' for one in arm.gravity_direction)}]",
        f"control_rate = {float(arm.control_rate)}",
    ]
    for module in range(arm.modules):
        lines += _module_lines(module, fit, layout, told, limits[module])
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    return tomli_w.dumps({"text": text}).removeprefix("text = ").strip()


def _module_lines(module: int, fit: Fit, layout: Layout, told: LogMap, limit: float) -> list[str]:
    arm, errors = told.arm, fit.errors
    lengths = np.exp(fit.guess.lengths)
    drives = layout.drive[module]
    off = np.rad2deg(errors.angles[drives]) if errors else np.zeros(len(drives))
    names = [told.drives[drive].measured or told.drives[drive].commanded for drive in drives]
    spread = float(np.sqrt(np.mean(errors.gains[drives] ** 2) / len(drives))) if errors else 0.0
    stated = arm.length is not None or arm.lengths is not None
    length = f"length = {lengths[module]:.5f}  # " + (
        "stated" if stated else f"+- {lengths[module] * errors.lengths[module]:.5f}" if errors else ""
    )
    radius = f"cable_radius = {layout.radii[module]:.5f}  # " + (
        "stated" if arm.cable_radius is not None else f"+- {layout.radii[module] * spread:.5f}"
    )
    return [
        "",
        "[[modules]]",
        length,
        radius,
        f"# +- {', '.join(f'{one:.1f}' for one in off)} deg; driven by {', '.join(map(str, names))}",
        f"# gains over their mean: {', '.join(f'{one:.3f} +- {two:.3f}' for one, two in zip(layout.gains[module], errors.gains[drives] if errors else drives, strict=True))}",
        f"cable_angles_deg = [{', '.join(f'{one:.2f}' for one in layout.angles_deg[module])}]",
        f"mass = {arm.mass}  # {_known(arm, 'mass')}",
        f"bending_stiffness = {arm.bending_stiffness}  # {_known(arm, 'bending_stiffness')}",
        f"bend_limit_deg = {limit:.1f}  # {'stated' if arm.bend_limit_deg else 'as far as was seen'}",
    ]


def _known(arm, key: str) -> str:
    return "stated" if key in arm.model_fields_set else "a guess"
