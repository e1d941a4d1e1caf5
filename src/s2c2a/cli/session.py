"""Command `s2c2a session`: measure the present day of an arm, and correct its model."""

from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

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
from s2c2a.errors import RecordingError, StrategyError
from s2c2a.files.text import MAX_COUNT


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
    from s2c2a import api, data, evaluation, strategies
    from s2c2a.arm import load_arm
    from s2c2a.models.session_fit import FEWEST

    networks = strategies.load_networks(weights, load_arm(arm) if arm else None)
    spec = networks.arm
    factory = robot_factory_for(robot, robot_option, fidelity, tracking=tracking)
    date = None
    motion = weights.with_suffix(".session.episodes")
    path = strategies.session_path(weights)
    # a session that fails replaces neither file of an earlier one
    with TemporaryDirectory(dir=weights.parent) as folder:
        recorded = Path(folder) / motion.name
        if recording is not None:
            moved = data.load_recording(recording)
            date = datetime.fromtimestamp(recording.stat().st_mtime, UTC)
        else:
            if "states" not in factory.make(spec).sensors:
                raise RecordingError(
                    f"{factory} measures no tip, and a session compares it with the model; "
                    "turn on the tracking (--tracking)"
                )
            least = FEWEST * spec.control_period
            if not least <= seconds < MAX_COUNT:
                raise RecordingError(
                    f"cannot judge a motion of {seconds:g} s; {FEWEST} samples are needed, "
                    f"{least:g} s of '{spec.name}'; give --seconds {max(50.0, least):g}"
                )
            with progress_bar() as progress, emergency_controls(factory):
                moved = api.collect(
                    spec,
                    recorded,
                    episodes=1,
                    samples=round(seconds / spec.control_period),
                    seed=seed,
                    recipe=networks.recipe,
                    robot=factory,
                    threads=1,
                    progress=partial(progress, f"moving {spec.name}"),
                )
        try:
            earlier = strategies.session_of(weights)
        except StrategyError:  # of another training, or damaged
            earlier = None
        new, fit = strategies.measured_session(networks, weights, moved, date, earlier)
        for line in evaluation.describe_session(fit, spec):
            print(line)
        if earlier and earlier.improves and new.change != earlier.change:
            kept = path.with_suffix(".earlier.json")
            strategies.save_session(earlier, kept)
            print(f"the earlier session is kept: {kept}")
        strategies.save_session(new, path)
        if recording is None:
            recorded.replace(motion)
    print(f"session: {path}")
