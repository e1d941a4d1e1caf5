"""Commands `s2c2a tracking latency` and `frames`: calibration of a pose tracker."""

from collections.abc import Callable
from typing import Any

import numpy as np

from s2c2a.arm import ArmSpec, load_arm
from s2c2a.cli.console import Arm, OptionalPath, print_table, progress_bar
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    RobotName,
    RobotOptions,
    TrackingSource,
    robot_factory_for,
)
from s2c2a.errors import S2C2AError, counted
from s2c2a.plugins.discovery import trust_code
from s2c2a.robots.factory import NO_TRACKING, RobotFactory


def latency(
    arm: Arm,
    robot: RobotName = "dynamixel",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    duration: float = 40.0,
    out: OptionalPath = None,
) -> None:
    """Find the latency of a tracker relative to the servos; the base module bends.

    Args:
        duration: of the motion [s].
        out: file of the result; by default that of the arm file, or
            NAME.tracking.json.
    """
    from s2c2a.lab.tracking.calibration_motions import CalibrationFile, measure_latency

    spec = load_arm(arm)
    # refuse the file of another arm before the arm moves
    file = CalibrationFile(spec, out)
    source = _source_of(spec, tracking)
    factory = robot_factory_for(robot, robot_option, tracking=NO_TRACKING)
    found = _measure(measure_latency, spec, source, factory, duration=duration)
    path = file.store_latency(found)
    print(
        f"latency: {1000 * found.seconds:.1f} ms, standard deviation "
        f"{1000 * found.std:.1f} ms; the servos explain {100 * found.explained:.0f} % "
        f"of the tracked motion; {path}"
    )


def frames(
    arm: Arm,
    robot: RobotName = "dynamixel",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    out: OptionalPath = None,
    overwrite: bool = False,
) -> None:
    """Find the frames of an arm in the tracked bodies; every module bends.

    A second start continues an interrupted one.

    Args:
        out: file of the result; by default that of the arm file, or
            NAME.tracking.json.
        overwrite: begin again, as after a body was moved on the arm.
    """
    from s2c2a.lab.tracking.calibration_motions import CalibrationFile, measure_frames

    spec = load_arm(arm)
    source = _source_of(spec, tracking)
    factory = robot_factory_for(robot, robot_option, tracking=NO_TRACKING)
    homed = factory.make(spec).last_calibration()
    file = CalibrationFile(spec, out, (factory, source, homed))
    if overwrite and file.last_held:
        file.store_held(())
    if before := file.held():
        print(
            f"{counted(len(before), 'bend')} held until {file.last_held:%Y-%m-%d %H:%M} "
            "need no second time; if a body was moved since, begin again (--overwrite)"
        )
    found = _measure(measure_frames, spec, source, factory, file=file)
    path = file.store_frames(found)
    rotations = np.rad2deg(found.rotation_residuals)
    rows = [
        (f"module {number}", f"{1000 * position:.2f}", f"{rotation:.2f}")
        for number, (position, rotation) in enumerate(
            zip(found.position_residuals, rotations, strict=True), 1
        )
    ]
    print_table("Residuals", ("end of", "position [mm]", "rotation [deg]"), rows)
    print(f"frames: {path}")


def _measure(
    procedure: Callable[..., Any],
    spec: ArmSpec,
    source: str,
    factory: RobotFactory,
    **settings,
) -> Any:
    """Run a procedure on an arm, with the keys and signals of an emergency stop."""
    from s2c2a.lab.tracking import tracker_of

    tracker = tracker_of(source)
    with emergency_controls(factory), progress_bar() as progress:
        return procedure(
            factory.make(spec),
            tracker,
            progress=lambda done, total: progress("motion", done, total),
            **settings,
        )


def _source_of(spec: ArmSpec, given: str) -> str:
    """Return the source of the command or of the arm file.

    Raises:
        S2C2AError: neither names one.
    """
    if given:
        trust_code(given)
        return given
    if spec.tracking is None:
        raise S2C2AError(
            f"'{spec.name}' names no tracker; add --tracking SOURCE, or a table "
            "[tracking] to the arm file (docs/guides/tracking.md)"
        )
    return spec.tracking.source
