"""Commands `s2c2a arm` (keys, check, draw, copy, random), `s2c2a robot`."""

import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from tyro.extras import SubcommandApp

from s2c2a.arm import (
    ArmSpec,
    Cable,
    Mismatch,
    file_keys,
    load_arm,
    randomized_arm,
    save_arm,
)
from s2c2a.arm.geometry import ArmGeometry, cables_present, per_module, per_unit_of_pull
from s2c2a.arm.spec import REQUIRED
from s2c2a.cli.console import Arm, File, GivenPath, OptionalPath, print_table
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    RobotName,
    RobotOptions,
    TrackingSource,
    robot_factory_for,
)

USUAL_FREQUENCIES = (0.2, 20.0)  # Hz, for a remark alone: periods of 0.05 to 5 s
USUAL_DAMPING = 0.03  # for a remark alone: 1 Hz then fades in 5 s

app = SubcommandApp()
robot_app = SubcommandApp()


@app.command
def keys() -> None:
    """List all keys of an arm file.

    Each has its table, its allowed values, its default and its meaning.
    """
    header = ("table", "key", "allowed", "default", "meaning")
    rows = [(key.table or "-", *key[1:]) for key in file_keys()]
    print_table("Keys of an arm file", header, rows, left_aligned=True)


@app.command
def check(arm: File) -> None:
    """Check an arm file, that the arm carries its own weight, and what follows from it."""
    from s2c2a.estimation import configuration_map_for
    from s2c2a.robots.simulation.modes import first_mode

    spec = load_arm(arm)
    configuration_map_for(spec)  # raises an error if `sensing` names no sensor
    # raises an error if gravity makes the arm collapse
    frequency, damping = first_mode(spec)
    print(f"{arm} is valid: {spec}")
    if spec.description:
        print(spec.description)
    print(
        f"sensing: {spec.sensing}, {spec.control_rate:g} Hz, gravity along "
        f"{list(spec.gravity_direction)} (base frame), coupled cables: "
        f"{spec.coupled_cables}"
    )
    print(f"first bending mode {frequency:.2f} Hz, damping ratio {damping:.2f}")
    rows = [_module_cells(spec, number) for number in range(spec.module_count)]
    print_table("Modules, base first", tuple(rows[0]), [row.values() for row in rows])
    low, high = USUAL_FREQUENCIES
    if not low <= frequency <= high:
        print(
            f"unusual: soft arms of this kind have {low:g} to {high:g} Hz; check "
            "bending_stiffness [N m2], mass [kg], length [m] and cable stiffness [N/m]"
        )
    if damping < USUAL_DAMPING:
        print(
            f"unusual: a damping ratio below {USUAL_DAMPING:g} lets the arm vibrate "
            "for minutes; check damping_time [s]"
        )
    if sensors := [name for name, value in spec.sensors if value]:
        print(f"further sensors: {', '.join(sensors)}")
    if spec.actuation != "displacement":
        print(_full_bends(spec))
    if spec.servos is not None:
        for part, ids in spec.servos.parts():
            place = f"on {part.port}" if part.port else "on the port of an option"
            print(f"servos: {len(ids)} {part.model} ({part.protocol}) {place}")
    if spec.tracking is not None:
        bodies = (spec.tracking.base, *spec.tracking.end_names(spec.module_count))
        names = ", ".join(filter(None, bodies))
        print(f"tracking: {names} by {spec.tracking.source}")
    if spec.sensors.imu is not None and find_spec("vqf") is None:
        print(
            "missing: [sensors.imu] needs the package vqf; install it, in your clone "
            'of s2c2a, with: pip install ".[sensors]"'
        )


def _full_bends(spec: ArmSpec) -> str:
    """Line about how far full tensions or pressures bend the modules of a force arm."""
    geometry = ArmGeometry.of(spec)
    pulls = np.abs(geometry.action_scale * per_unit_of_pull(spec))
    # of evenly spread cables, half of the pulls bend
    moments = pulls * geometry.cable_radii * cables_present(spec).sum(axis=1) / 2.0
    bends = moments * geometry.lengths / per_module(spec, "bending_stiffness")
    bends_deg = np.rad2deg(bends).round().astype(int)
    limits_deg = np.rad2deg(geometry.bend_limits).round().astype(int)
    return (
        f"full {REQUIRED[spec.actuation][0]} bends the modules by about "
        f"{', '.join(map(str, bends_deg))} deg against their stiffness; their "
        f"bend_limit_deg: {', '.join(map(str, limits_deg))}"
    )


def _module_cells(spec: ArmSpec, number: int) -> dict[str, str]:
    module = spec.modules[number]
    has_stiffness = spec.actuation == "displacement"
    return {
        "module": str(number + 1),
        "length m": f"{module.length:g}",
        "cables deg": " ".join(f"{angle:g}" for angle in module.cable_angles_deg),
        "cables at mm": f"{1e3 * module.cable_radius:g}",
        "mass g": f"{1e3 * module.mass:g}",
        "EI N m2": f"{module.bending_stiffness:g}",
        "bend deg": f"{module.bend_limit_deg:g}",
        "cable N/m": f"{module.cable.stiffness:g}" if has_stiffness else "-",
        "hysteresis": _describe_hysteresis(module.cable),
        "mismatch": "none" if module.mismatch == Mismatch() else "yes",
    }


def _describe_hysteresis(cable: Cable) -> str:
    parts = []
    if cable.backlash:
        backlashes = np.atleast_1d(cable.backlash)
        widths = " ".join(f"{1e3 * backlash:g}" for backlash in backlashes)
        parts.append(f"backlash {widths} mm")
    if cable.friction:
        parts.append(f"friction {cable.friction:g}")
    if cable.creep:
        parts.append(f"creep {cable.creep:g}")
    return ", ".join(parts) or "none"


@app.command
def draw(arm: File, out: OptionalPath = None) -> None:
    """Draw an arm to scale and save the figure.

    Args:
        out: the figure (.png, .pdf or .svg); by default a PNG in the current folder,
            named after the arm file.
    """
    from s2c2a.viz import arm_figure

    path = out or Path(f"{Path(arm).stem}.png")
    print(f"figure: {arm_figure(load_arm(arm), path)}")


@app.command
def copy(arm: File, out: GivenPath, overwrite: bool = False) -> None:
    """Copy an arm to a new arm file, named after the file, to edit it there.

    Args:
        out: the new arm file.
        overwrite: replace the file if it exists.
    """
    # names begin with a letter or a digit, and have at most 64 characters
    name = re.sub(r"[^A-Za-z0-9_-]", "_", out.stem).lstrip("_-")[:64] or "arm"
    table = load_arm(arm).model_dump() | {"name": name, "description": ""}
    save_arm(ArmSpec.model_validate(table), out, overwrite)
    print(f"arm: {out}; edit it and run `s2c2a arm check {out}`")


@app.command
def random(
    seed: int,
    strength: float = 1.0,
    base: Arm = "twin_arm",
    out: OptionalPath = None,
    overwrite: bool = False,
) -> None:
    """Sample an arm with the model mismatch of real arms (docs/concepts/simulator.md).

    Only the simulation knows the mismatch; the controllers do not.

    Args:
        seed: random seed of the mismatch.
        strength: magnitude of the mismatch: 1 for that of a carefully built arm, 0.5
            for half of it, 0 for none; at most 2.
        out: the new arm file; by default in the current folder, named after the arm.
        overwrite: replace the file if it exists.
    """
    from s2c2a.robots.simulation.modes import first_mode

    arm = randomized_arm(load_arm(base), seed, strength)
    first_mode(arm)  # raises an error if gravity makes the arm collapse
    path = out or Path(f"{arm.name}.toml")
    save_arm(arm, path, overwrite)
    print(
        f"arm: {path}; use it with --arm {path} in `collect`, `train` and `run`, and "
        "add --robot-option aged=1 to `run`"
    )


@robot_app.command(name="check")
def check_contract(
    robot: RobotName = "sim",
    arm: Arm = "twin_arm",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
) -> None:
    """Test whether a robot fulfills its interface contract; it moves the arm.

    Every cable moves by at most 5 % of its range. Keep clear of the arm.
    """
    from s2c2a.runtime import check_robot

    factory = robot_factory_for(robot, robot_option, tracking=tracking)
    opened = factory.seeded(load_arm(arm), 0)
    with emergency_controls(factory):
        for result in check_robot(opened):
            print(f"ok: {result}")
    print(f"{factory} fulfills the interface contract")
