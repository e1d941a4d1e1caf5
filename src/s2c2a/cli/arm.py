"""`s2c2a arm`: keys, check, describe, draw, copy; and `s2c2a robot`: check."""

import re
from pathlib import Path

from tyro.extras import SubcommandApp

from s2c2a.arm import (
    ArmSpec,
    Cable,
    Mismatch,
    randomized_arm,
    file_keys,
    load_arm,
    save_arm,
)
from s2c2a.cli.console import Arm, File, print_table
from s2c2a.cli.execution import RobotName, RobotOptions, body_for

app = SubcommandApp()
robot_app = SubcommandApp()


@app.command
def keys() -> None:
    """Say what can stand in an arm file, key by key."""
    header = ("table", "key", "allowed", "if not stated", "what it is")
    rows = [(key.table or "-", *key[1:]) for key in file_keys()]
    print_table("Keys of an arm file", header, rows, left_aligned=True)


@app.command
def check(arm: File) -> None:
    """Check an arm file, and that the arm stands.

    Args:
        arm: a preset or an arm file.
    """
    from s2c2a.robots.simulation.modes import first_mode

    spec = load_arm(arm)
    first_mode(spec)  # refuses an arm that falls over
    modules = f"{spec.module_count} module{'s' if spec.module_count > 1 else ''}, {spec.cable_count} cables each"
    print(
        f"{arm}: {spec.name} is sound: {modules}, {spec.length:.3g} m, {spec.actuation}"
    )


@app.command
def describe(arm: File) -> None:
    """Say what an arm is, with what follows from its numbers.

    Args:
        arm: a preset or an arm file.
    """
    from s2c2a.robots.simulation.modes import first_mode

    spec = load_arm(arm)
    frequency, damping = first_mode(spec)
    print(f"{spec.name}: {spec.description}" if spec.description else spec.name)
    print(
        f"actuation by {spec.actuation}, sensing: {spec.sensing}, {spec.control_rate:g} Hz"
    )
    print(
        f"gravity along {list(spec.gravity_direction)} (base frame), coupled cables: {spec.coupled_cables}"
    )
    print(
        f"length {spec.length:.3g} m, first bending mode {frequency:.2f} Hz, damping ratio {damping:.2f}"
    )
    rows = [_cells(spec, number) for number in range(spec.module_count)]
    print_table("Modules, base first", tuple(rows[0]), [row.values() for row in rows])


def _cells(spec: ArmSpec, number: int) -> dict[str, str]:
    module = spec.modules[number]
    return {
        "module": str(number + 1),
        "length m": f"{module.length:g}",
        "cables deg": " ".join(f"{angle:g}" for angle in module.cable_angles_deg),
        "radius mm": f"{1e3 * module.cable_radius:g}",
        "mass g": f"{1e3 * module.mass:g}",
        "EI N m2": f"{module.bending_stiffness:g}",
        "bend deg": f"{module.bend_limit_deg:g}",
        "cable N/m": f"{module.cable.stiffness:g}"
        if spec.actuation == "displacement"
        else "-",
        "hysteresis": _hysteresis(module.cable),
        "mismatch": "none" if module.mismatch == Mismatch() else "yes",
    }


def _hysteresis(cable: Cable) -> str:
    backlashes = (
        cable.backlash if isinstance(cable.backlash, tuple) else (cable.backlash,)
    )
    widths = " ".join(f"{1e3 * backlash:g}" for backlash in backlashes)
    said = {
        "backlash": f"{widths} mm",
        "friction": f"{cable.friction:g}",
        "creep": f"{cable.creep:g}",
    }
    return (
        ", ".join(
            f"{name} {value}" for name, value in said.items() if getattr(cable, name)
        )
        or "none"
    )


@app.command
def draw(arm: File, out: Path | None = None) -> None:
    """Draw an arm, to scale, into a picture.

    Args:
        arm: a preset or an arm file.
        out: where to; here, under the file's own name, if not stated. Ends in .png,
            .pdf or .svg.
    """
    from s2c2a.viz import arm_figure

    spec = load_arm(arm)
    print(f"drawn: {arm_figure(spec, out or Path(f'{Path(arm).stem}.png'))}")


@app.command
def copy(arm: File, out: File, overwrite: bool = False) -> None:
    """Write an arm to a file of your own, named after the file, to change there.

    Args:
        arm: a preset or an arm file.
        out: the new arm file.
        overwrite: replace the file if it exists.
    """
    own = {
        "name": re.sub(r"[^A-Za-z0-9_-]", "_", Path(out).stem) or "arm",
        "description": "",
    }
    save_arm(ArmSpec.model_validate(load_arm(arm).model_dump() | own), out, overwrite)
    print(f"written: {out}; change it and try `s2c2a arm check {out}`")


@app.command
def random(
    seed: int,
    strength: float = 1.0,
    base: Arm = "twin_arm",
    out: Path | None = None,
    overwrite: bool = False,
) -> None:
    """Draw an arm with the mismatch of real arms, which only its simulated body knows of (docs/simulator.md).

    Args:
        seed: of everything that is drawn.
        strength: 1 for mismatch as large as a careful builder's, 0.5 for half of that, 0
            for the base itself; at most 2.
        base: a preset or an arm file: modules, cables, and all that controllers are
            told.
        out: the new arm file; here, under the arm's own name, if not stated.
        overwrite: replace the file if it exists.
    """
    from s2c2a.robots.simulation.modes import first_mode

    drawn = randomized_arm(load_arm(base), seed, strength)
    first_mode(drawn)  # refuses an arm that falls over
    written = out or Path(f"{drawn.name}.toml")
    save_arm(drawn, written, overwrite)
    print(
        f"written: {written}; collect, train and run it with --arm {written}, and runs with --robot-option aged=1"
    )


@robot_app.command(name="check")
def check_body(
    robot: RobotName = "sim",
    arm: Arm = "twin_arm",
    robot_option: RobotOptions = (),
    response: bool = False,
    weights: Path | None = None,
    out: Path | None = None,
) -> None:
    """Open a body, drive it gently, and see that it keeps the promises that everything here relies on.

    It moves every cable by at most 5 % of its range; with --response it makes the arm
    swing. Keep clear of it.

    Args:
        robot: the simulated arm, or a class of your own such as my_arm.py:MyArm.
        arm: a preset or an arm file: what the body is.
        robot_option: what the class takes.
        response: measure how the arm swings and how late it answers, instead: it is
            shaken for about a minute, every module by a tenth of its bend limit, slowly
            at first, then faster (docs/sensors.md).
        weights: made by `s2c2a train`: what is expected follows from them, and the
            response is held against the margins of their loop.
        out: a file (.json) for what was found, with a figure beside it.
    """
    from s2c2a.cli.response import check_alone, check_response
    from s2c2a.robots import check_robot

    check_alone(response, weights=weights, out=out)
    body = body_for(robot, robot_option)
    opened = body.seeded(load_arm(arm), 0)
    if response:
        return check_response(opened, weights, out)
    for kept in check_robot(opened):
        print(f"ok: {kept}")
    print(f"{body} keeps its promises")
