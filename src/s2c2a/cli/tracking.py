"""Commands `s2c2a tracking`: calibration of a pose tracker for an arm."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from tyro.extras import SubcommandApp

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import Arm, print_table, progress_bar
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import RobotName, RobotOptions, robot_factory_for

if TYPE_CHECKING:
    from s2c2a.identification.tracking import Calibrated
    from s2c2a.tracking.frames import Frames

app = SubcommandApp()
Source = Annotated[str, tyro.conf.arg(metavar="SOURCE")]


@app.command
def latency(
    tracking: Source,
    arm: Arm,
    robot: RobotName = "dynamixel",
    robot_option: RobotOptions = (),
    duration: float = 40.0,
    out: Path | None = None,
) -> None:
    """Find the latency of a tracker relative to the servos; the base module bends.

    Args:
        tracking: source of the poses, such as natnet or udp:9763 (docs/tracking.md).
        arm: a preset or an arm file.
        robot: servos (dynamixel, feetech), or your own class.
        robot_option: further arguments of that class.
        duration: of the motion [s].
        out: file of the result; by default NAME.tracking.json.
    """
    from s2c2a.identification.tracking import measure_latency

    spec = load_arm(arm)
    calibrated = _calibrated(spec, out)
    found = _measure(
        measure_latency, spec, tracking, robot, robot_option, duration=duration
    )
    path = calibrated.store_latency(found)
    print(
        f"latency: {1000 * found.seconds:.1f} ms, standard deviation "
        f"{1000 * found.std:.1f} ms; the servos explain {100 * found.explained:.0f} % "
        f"of the tracked motion; {path}"
    )


@app.command
def frames(
    tracking: Source,
    arm: Arm,
    robot: RobotName = "dynamixel",
    robot_option: RobotOptions = (),
    out: Path | None = None,
) -> None:
    """Find the frames of an arm in the tracked bodies; every module bends.

    Args:
        tracking: source of the poses, such as natnet or udp:9763 (docs/tracking.md).
        arm: a preset or an arm file.
        robot: servos (dynamixel, feetech), or your own class.
        robot_option: further arguments of that class.
        out: file of the result; by default NAME.tracking.json.
    """
    from s2c2a.identification.tracking import measure_frames

    spec = load_arm(arm)
    calibrated = _calibrated(spec, out)
    found = _measure(measure_frames, spec, tracking, robot, robot_option)
    path = calibrated.store_frames(found)
    _print_residuals(found)
    print(f"frames: {path}")


def _calibrated(spec: ArmSpec, out: Path | None) -> "Calibrated":
    """Refuse the file of another arm before the arm moves."""
    from s2c2a.identification.tracking import Calibrated

    return Calibrated(spec, out)


def _measure(
    procedure: Callable[..., Any],
    spec: ArmSpec,
    source: str,
    robot: str,
    options: tuple[str, ...],
    **settings,
) -> Any:
    """Run a procedure on an arm, with the keys and signals of an emergency stop."""
    from s2c2a.hardware.end_tracking import _tracker_of

    tracker = _tracker_of(source)
    factory = robot_factory_for(robot, options)
    with emergency_controls(factory), progress_bar() as progress:
        return procedure(
            factory.make(spec),
            tracker,
            progress=lambda done, total: progress("motion", done, total),
            **settings,
        )


def _print_residuals(found: "Frames") -> None:
    rotations = np.rad2deg(found.rotation_residuals)
    rows = [
        (f"end-{number}", f"{1000 * position:.2f}", f"{rotation:.2f}")
        for number, (position, rotation) in enumerate(
            zip(found.position_residuals, rotations, strict=True), 1
        )
    ]
    print_table("Residuals", ("body", "position [mm]", "rotation [deg]"), rows)
