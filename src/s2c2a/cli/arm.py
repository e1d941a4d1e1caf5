"""`s2c2a arm`: keys, check, describe, draw, copy."""

import re
from pathlib import Path

from tyro.extras import SubcommandApp

from s2c2a.arm import ArmSpec, file_keys, load_arm, save_arm
from s2c2a.cli.console import File, print_table

app = SubcommandApp()


@app.command
def keys() -> None:
    """Say what can stand in an arm file, key by key."""
    rows = [(key.table or "-", *key[1:]) for key in file_keys()]
    print_table(
        "Keys of an arm file", ("table", "key", "allowed", "if not stated", "what it is"), rows, left_aligned=True
    )


@app.command
def check(arm: File) -> None:
    """Check an arm file, and that the arm stands.

    Args:
        arm: a preset or an arm file.
    """
    from s2c2a.robots.simulation.modes import first_mode

    spec = load_arm(arm)
    first_mode(spec)  # refuses an arm that falls over
    modules = f"{spec.module_count} module{'s' if spec.module_count > 1 else ''}"
    print(
        f"{arm}: {spec.name} is sound: {modules}, {spec.cable_count} cables each, {spec.length:.3g} m, {spec.actuation}"
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
        f"actuation by {spec.actuation}, sensing: {spec.sensing}, {spec.control_rate:g} Hz, length {spec.length:.3g} m"
    )
    print(f"gravity along {list(spec.gravity_direction)} (base frame), coupled cables: {spec.coupled_cables}")
    print(f"first bending mode {frequency:.2f} Hz, damping ratio {damping:.2f}")
    header = (
        "module",
        "length m",
        "cables deg",
        "radius mm",
        "mass g",
        "EI N m2",
        "bend deg",
        "cable N/m",
        "hysteresis",
    )
    rows = [
        (
            str(number + 1),
            f"{module.length:g}",
            " ".join(f"{angle:g}" for angle in module.cable_angles_deg),
            f"{1e3 * module.cable_radius:g}",
            f"{1e3 * module.mass:g}",
            f"{module.bending_stiffness:g}",
            f"{module.bend_limit_deg:g}",
            f"{module.cable.stiffness:g}" if spec.actuation == "displacement" else "-",
            _hysteresis(module.cable),
        )
        for number, module in enumerate(spec.modules)
    ]
    print_table("Modules, base first", header, rows)


def _hysteresis(cable) -> str:
    parts = [f"play {1e3 * cable.play:g} mm"] if cable.play else []
    parts += [f"friction {cable.friction:g}"] if cable.friction else []
    parts += [f"creep {cable.creep:g}"] if cable.creep else []
    return ", ".join(parts) or "none"


@app.command
def draw(arm: File, out: Path | None = None) -> None:
    """Draw an arm, to scale, into a picture.

    Args:
        arm: a preset or an arm file.
        out: where to; here, under the file's own name, if not stated. Ends in .png, .pdf or .svg.
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
    own = {"name": re.sub(r"[^A-Za-z0-9_-]", "_", Path(out).stem) or "arm", "description": ""}
    save_arm(ArmSpec.model_validate(load_arm(arm).model_dump() | own), out, overwrite)
    print(f"written: {out}; change it and try `s2c2a arm check {out}`")
