"""Collection of recordings: parallel episodes, written in order, resumable.

The control loop of `s2c2a run` drives each episode.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.babbling import BABBLING, episode_actions
from s2c2a.data.recording import Recording, load_recording
from s2c2a.episodes import Episode, EpisodeWriter
from s2c2a.episodes.episode import SENSOR
from s2c2a.episodes.file import ENDING
from s2c2a.errors import RecordingError, RobotError, listed, no_such
from s2c2a.execution.executors import Serial, Threads, in_order
from s2c2a.files.text import MAX_COUNT, MAX_SEED, check_replaceable, is_seed
from s2c2a.measurements.outliers import MeasuredEnds, find_outliers
from s2c2a.measurements.readings import MAX_SILENCE
from s2c2a.paper import SPEEDS
from s2c2a.printing import differences
from s2c2a.robots import Robot
from s2c2a.runtime import (
    CommandLimits,
    Loop,
    Player,
    StepRecord,
    StepRequest,
    build_episode,
)
from s2c2a.runtime.border import attribute
from s2c2a.spaces import AXIS, POSITION, Stage

EXCLUDED = "excluded_poses"  # option of an episode
FROZEN = "frozen_poses"  # those among them that repeat an earlier one
PAPER_STEP_LIMIT_DEG = 4.0  # of the arm that the speeds are stated for
MakeRobot = Callable[[int], Robot]


@dataclass(frozen=True)
class CollectOptions:
    """Options of a collection.

    Attributes:
        babbling: one of `BABBLING`.
        episodes: number of episodes, each from rest.
        samples: number of control steps in an episode.
        seed: seed of all random numbers.
        speeds: slowest and fastest approach of a bend target, as a share of the full
            bend per step, for a step limit of 4 deg; they scale with the step limit, so
            that the recording covers the steps of the arm.
    """

    babbling: str = "staged"
    episodes: int = 18
    samples: int = 500
    seed: int = 0
    speeds: tuple[float, float] = SPEEDS

    def __post_init__(self):
        if self.babbling not in BABBLING:
            raise RecordingError(no_such("babbling", self.babbling, BABBLING))
        counts = (self.episodes, self.samples)
        has_counts = all(1 <= count <= MAX_COUNT and not count % 1 for count in counts)
        if not has_counts or not is_seed(self.seed):
            raise RecordingError(
                f"episodes {self.episodes}, samples {self.samples}, seed {self.seed} are "
                f"out of range; give whole numbers, 1 to {MAX_COUNT} for episodes and "
                f"samples, and 0 to {MAX_SEED} for the seed"
            )
        if not 0 < self.speeds[0] <= self.speeds[1] <= 1:
            raise RecordingError(
                f"speeds {self.speeds} are out of range; "
                "they must rise from above 0 to at most 1 bend a step"
            )


def collect(
    path: str | os.PathLike,
    arm: ArmSpec,
    make_robot: MakeRobot,
    options: CollectOptions,
    *,
    robot: str = "",
    threads: int | None = None,
    executor: Executor | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda complete, episodes: None,
) -> Recording:
    """Collect a recording, identical for any number of threads, stops, and resumes.

    Args:
        path: file to write.
        arm: arm to drive.
        make_robot: function from a seed to a robot; called once per episode, in its
            thread.
        options: options of the collection.
        robot: description of the robot, such as "simulation fast"; the recording keeps
            it.
        threads: number of parallel episodes; all cores by default. Use one for a real
            arm.
        executor: executor of the episodes instead of threads. If it has other
            processes, `make_robot` must be picklable: a `partial` of a class is, a
            lambda is not.
        resume: whether to continue a file that has too few episodes.
        overwrite: whether to replace an existing file.
        progress: callback with the number of complete episodes and of all episodes.

    Raises:
        RecordingError: the file exists and neither `resume` nor `overwrite` is set, it
            was started with other options, or it cannot be written.
        S2C2AError: `threads` is below one.
    """
    workers: AbstractContextManager[Executor]
    if executor:
        workers = nullcontext(executor)
    else:
        # serial: a real arm starts an episode after the last one is written
        workers = Serial() if threads == 1 else Threads(threads)
    # as a recording stores them: single numbers and words
    stored = asdict(options) | {"robot": robot}
    slowest, fastest_share = stored.pop("speeds")
    stored |= {"slowest": slowest, "fastest": fastest_share}
    path = Path(path)
    if not path.exists() or overwrite:
        check_replaceable(path, ENDING, RecordingError)
        writer = EpisodeWriter.create(path, arm, stored)
    elif not resume:
        raise RecordingError(
            f"{path} exists; continue it (--resume), replace it (--overwrite), or "
            "choose another name"
        )
    else:
        writer = EpisodeWriter(path)
        found = [
            *differences(writer.options, stored),
            *differences(writer.arm.model_dump(), arm.model_dump(), "arm"),
        ]
        if found:
            writer.close()
            raise RecordingError(
                f"{path} was started with another arm or other options "
                f"({listed(found, '; ')}); resume it with the same ones, or replace "
                "it (--overwrite)"
            )
    try:
        with workers as pool:
            progress(writer.count, options.episodes)
            run_episode = partial(_run_episode, arm, make_robot, options)
            numbers = range(writer.count, options.episodes)
            for episode in in_order(pool, run_episode, numbers):
                writer.append(episode)
                progress(writer.count, options.episodes)
    finally:
        writer.close()
        if writer.count == 0:  # no episode was recorded, as without any pose
            path.unlink(missing_ok=True)
    return load_recording(path)


def _run_episode(
    arm: ArmSpec, make_robot: MakeRobot, options: CollectOptions, number: int
) -> Episode:
    """Drive the arm through one episode and back to rest.

    Args:
        arm: arm to drive.
        make_robot: function from a seed to a robot.
        options: options of the collection.
        number: of the episode.

    Raises:
        RecordingError: a sensor failed; the arm is at rest, and the episode is dropped.
    """
    geometry = ArmGeometry.of(arm)
    scale = arm.step_limit_deg / PAPER_STEP_LIMIT_DEG
    slow, fast = options.speeds
    speeds = (min(slow * scale, 1.0), min(fast * scale, 1.0))
    actions = episode_actions(
        geometry,
        options.babbling,
        number,
        options.episodes,
        options.samples,
        options.seed,
        speeds,
    )
    seed = np.random.SeedSequence([options.seed, number, 1]).generate_state(1)[0]
    robot = make_robot(int(seed))
    # a real arm keeps its own limits
    limits = None
    own_time = attribute(robot, "own_time", RobotError)
    if own_time:
        # those that this motion needs, in which mixed paths add up
        steps = np.diff(actions, axis=0, prepend=geometry.action_neutral[None])
        sizes = CommandLimits.of(arm).change_sizes(steps)
        step = (1 + 1e-6) * sizes.max(axis=0, initial=speeds[1])
        limits = CommandLimits(geometry, step, 2 * step)
    sensors = attribute(robot, "sensors", RobotError)
    required = [name for name, sensor in sensors.items() if sensor.always]
    player = Player(arm, tuple(required), actions)
    with Loop(robot, player, limits=limits) as loop:
        episode = build_episode(_episode_steps(loop, len(actions), number), arm)
    columns = _without_gaps(episode, player.sensors)
    # without computing times, the file is identical on any machine
    columns.pop("tick_time", None)
    metadata = dict(episode.options)
    if not own_time:
        metadata |= _exclude_outliers(columns)
    return replace(episode, columns=columns, options=metadata)


def _exclude_outliers(columns: dict[str, np.ndarray]) -> dict[str, int]:
    """Replace measured states that cannot be true by NaN, and count them by kind.

    A tracker's check of single frames (`lab.tracking.plausibility`) allows any shape that
    the arm can have; here the states of an episode must also fit its cables.
    """
    states = columns.get(SENSOR + "states")
    if states is None:
        return {EXCLUDED: 0, FROZEN: 0}
    cables = columns.get(SENSOR + "cables", columns["actions"])
    rows = len(states)
    ends = MeasuredEnds(
        cables.reshape(rows, -1),
        states[..., POSITION],
        states[..., AXIS],
        np.zeros(rows, int),
    )
    outliers = find_outliers(ends)
    # so many are no marker jumps: motors or cables are at fault, and `train` shows it
    if outliers.is_excessive:
        return {EXCLUDED: 0, FROZEN: 0}
    columns[SENSOR + "states"] = np.where(outliers.all[..., None], np.nan, states)
    return {EXCLUDED: outliers.count, FROZEN: int(outliers.frozen.sum())}


def describe_excluded(recording: Recording) -> str:
    """Describe how many measured poses were excluded; empty if none."""
    counts = [episode.options.get(EXCLUDED, 0) for episode in recording.episodes]
    total = sum(counts)
    if not total:
        return ""
    frozen = sum(episode.options.get(FROZEN, 0) for episode in recording.episodes)
    others = total - frozen
    kinds = []
    if frozen:
        kinds.append(f"{frozen} frozen (the last pose of a lost body again)")
    if others:
        kinds.append(f"{others} that the cables do not explain, such as marker jumps")
    first = next(number for number, count in enumerate(counts, 1) if count)
    poses = recording.sensor("states")[..., 0].size
    return (
        f"excluded {total} of {poses} poses: {', '.join(kinds)}; the "
        f"first in episode {first} (docs/guides/import.md)"
    )


def _episode_steps(loop: Loop, count: int, number: int) -> list[StepRecord]:
    """Do the steps of an episode.

    Raises:
        RecordingError: a sensor failed for longer than `MAX_SILENCE`.
    """
    steps: list[StepRecord] = []
    gap = 0
    for _ in range(count):
        step = loop.tick(StepRequest())
        steps.append(step)
        gap = gap + 1 if step.stage is Stage.HOLD else 0
        if gap > MAX_SILENCE or step.stage not in (Stage.RUN, Stage.HOLD):
            raise RecordingError(
                f"episode {number + 1}, step {len(steps)}: {loop.fault}; "
                "correct that, then continue (--resume)"
            )
    return steps


def _without_gaps(episode: Episode, sensors: Iterable[str]) -> dict[str, np.ndarray]:
    """Columns in which short gaps of sensors are interpolated.

    The arm is held in a step with an unsound reading, such as after a lost packet; the
    stage of the step is `HOLD`.
    """
    columns = dict(episode.columns)
    is_sound = episode.columns["stage"] == Stage.RUN
    if is_sound.all():
        return columns
    times = episode.columns["time"]
    for name in sensors:
        values = columns[SENSOR + name].copy()
        series = values.reshape(len(values), -1)
        for column in series.T:
            is_known = is_sound & np.isfinite(column)
            column[:] = np.interp(times, times[is_known], column[is_known])
        columns[SENSOR + name] = values
    return columns
