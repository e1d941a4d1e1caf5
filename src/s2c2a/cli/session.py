"""Command `s2c2a session`: measure the present day of an arm, and correct its model."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

from s2c2a.cli.console import FidelityName, OptionalArm, OptionalPath, progress_bar
from s2c2a.cli.dependent_options import effective
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    RobotName,
    RobotOptions,
    TrackingSource,
    robot_factory_for,
)
from s2c2a.errors import RecordingError
from s2c2a.files.text import MAX_COUNT

if TYPE_CHECKING:
    from s2c2a import data, strategies
    from s2c2a.robots import RobotFactory


@effective(
    "robot",
    "robot_option",
    "tracking",
    "fidelity",
    "seconds",
    "seed",
    where="without --recording",
    holds=lambda given: given["recording"] is None,
)
def session(
    weights: tyro.conf.Positional[Path],
    arm: OptionalArm = None,
    recording: OptionalPath = None,
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    fidelity: FidelityName = "fast",
    seconds: float = 50.0,
    seed: int = 0,
) -> None:
    """Measure how an arm has changed since its training; `run` and `live` then use it.

    The arm moves as in `collect`, with the tip tracked. What is found is printed, and
    stored beside the weights (docs/guides/session.md).

    Args:
        weights: file of `s2c2a train`.
        arm: a preset or an arm file; by default that of the weights.
        recording: of the present day, of `s2c2a collect` or `s2c2a import`; the arm is
            then not moved.
        seconds: for which the arm moves.
        seed: of its motion.
    """
    from s2c2a import data, evaluation, strategies
    from s2c2a.arm import load_arm

    spec = load_arm(arm) if arm else None
    networks = strategies.load_networks(weights, spec)
    date = None
    if recording is not None:
        moved = data.load_recording(recording)
        date = datetime.fromtimestamp(recording.stat().st_mtime, UTC)
    else:
        factory = robot_factory_for(robot, robot_option, fidelity, tracking=tracking)
        moved = _move(networks, factory, seconds, seed, weights)
    found, fit = strategies.measured_session(networks, weights, moved, date)
    for line in evaluation.describe_session(fit, networks.arm):
        print(line)
    path = strategies.session_path(weights)
    strategies.save_session(found, path)
    print(f"session: {path}")


def _move(
    networks: "strategies.TrainedNetworks",
    factory: "RobotFactory",
    seconds: float,
    seed: int,
    weights: Path,
) -> "data.Recording":
    """Move the arm as in the training, and record it beside the weights.

    Raises:
        RecordingError: the tip would not be seen, or the time is impossible.
    """
    from s2c2a import data

    arm = networks.arm
    if "states" not in factory.make(arm).sensors:
        raise RecordingError(
            f"{factory} measures no tip, and a session compares it with the model; turn "
            "on the tracking (--tracking)"
        )
    if not 0.0 < seconds < MAX_COUNT:
        raise RecordingError(f"cannot move for {seconds:g} s; give --seconds 50")
    options = replace(
        networks.recipe.collect_options(seed),
        episodes=1,
        samples=round(seconds / arm.control_period),
    )
    with progress_bar() as progress, emergency_controls(factory):
        return data.collect(
            weights.with_suffix(".session.episodes"),
            arm,
            partial(factory.seeded, arm),
            options,
            robot=str(factory),
            threads=1,
            overwrite=True,
            progress=partial(progress, f"moving {arm.name}"),
        )
