"""Collecting a recording: episodes side by side, written in order, resumable."""

import os
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

import s2c2a
from s2c2a.arm import ArmGeometry, ArmSpec, arm_to_toml
from s2c2a.data.babbling import BABBLING, SPEEDS, episode_actions
from s2c2a.data.recording import Recording, RecordingWriter, load_recording
from s2c2a.errors import RecordingError
from s2c2a.robots import Robot
from s2c2a.shards import Crew, Here, Threads, in_order

MakeRobot = Callable[[int], Robot]


@dataclass(frozen=True)
class CollectOptions:
    """How to collect.

    Attributes:
        babbling: "staged" or "motor".
        episodes: number of episodes, each from rest.
        samples: control steps in an episode.
        seed: of everything random.
        speeds: slowest and fastest approach of a bend target, as part of the full bend per step.
    """

    babbling: str = "staged"
    episodes: int = 18
    samples: int = 500
    seed: int = 0
    speeds: tuple[float, float] = SPEEDS

    def __post_init__(self):
        if self.babbling not in BABBLING:
            raise RecordingError(f"no babbling '{self.babbling}'; choose one of {', '.join(BABBLING)}")
        if self.episodes < 1 or self.samples < 1:
            raise RecordingError(f"{self.episodes} episodes of {self.samples} samples asked for; both must be positive")
        if self.seed < 0:
            raise RecordingError(f"seed {self.seed} asked for; it must not be negative")
        if not 0 < self.speeds[0] <= self.speeds[1] <= 1:
            raise RecordingError(
                f"speeds {self.speeds} asked for; they must rise from above 0 to at most 1 bend a step"
            )


def collect(
    path: str | os.PathLike,
    arm: ArmSpec,
    make_robot: MakeRobot,
    options: CollectOptions,
    *,
    body: str = "",
    threads: int | None = None,
    crew: Crew | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Recording:
    """Collect a recording, the same whoever drives its episodes and however often it was killed and resumed.

    Args:
        path: the file to write.
        arm: the arm to drive.
        make_robot: a robot for the episode of the given seed; called once an episode, in its thread.
        options: how to babble.
        body: what the robot is, kept with the recording, such as "simulation fast".
        threads: episodes side by side; all cores if not stated. A real arm takes one.
        crew: who drives the episodes, if not threads of this process; then `make_robot` has to travel, as a `partial`
            of a class does and a lambda does not.
        resume: go on with a file that has fewer episodes than asked for.
        overwrite: begin anew where a file exists.
        progress: told how many episodes of how many are whole.

    Raises:
        RecordingError: the file exists and neither `resume` nor `overwrite` was asked for, it was begun otherwise, or
            it cannot be written.
    """
    if threads is not None and threads < 1:
        raise RecordingError(f"{threads} threads asked for; take at least one, or leave it out for all cores")
    drive = partial(_episode, arm, make_robot, options)
    writer = _open_writer(
        Path(path), arm, _as_written(options) | {"body": body, "version": s2c2a.__version__}, resume, overwrite
    )
    try:
        left = range(writer.committed, options.episodes)
        progress(writer.committed, options.episodes)
        with nullcontext(crew) if crew else _threads(threads) as these:
            for episode in in_order(these, drive, left):
                writer.append(episode)
                progress(writer.committed, options.episodes)
    finally:
        writer.close()
    return load_recording(path)


def _threads(count: int | None) -> Crew:
    return Here() if count == 1 else Threads(count)  # a real arm: nothing is begun before the last episode is safe


def _as_written(options: CollectOptions) -> dict:
    """Options as they stand in a file: one number or word each."""
    written = asdict(options)
    slowest, fastest = written.pop("speeds")
    return written | {"slowest": slowest, "fastest": fastest}


def _open_writer(path: Path, arm: ArmSpec, options: dict, resume: bool, overwrite: bool) -> RecordingWriter:
    if not path.exists() or overwrite:
        return RecordingWriter.create(path, arm, options)
    if not resume:
        raise RecordingError(f"{path} exists; go on with it (--resume), begin anew (--overwrite), or take another name")
    writer = RecordingWriter(path)
    begun_arm, begun = writer.arm_and_options()
    differing = [
        f"{key} {begun.get(key)!r}, now {value!r}" for key, value in options.items() if begun.get(key) != value
    ]
    differing += ["arm"] if begun_arm != arm_to_toml(arm) else []
    if differing:
        writer.close()
        raise RecordingError(
            f"{path} was begun with another arm or other options ({'; '.join(differing)}); "
            "resume it as begun, or say overwrite"
        )
    return writer


def _episode(arm: ArmSpec, make_robot: MakeRobot, options: CollectOptions, number: int) -> dict[str, np.ndarray]:
    actions = episode_actions(
        ArmGeometry.of(arm), options.babbling, number, options.episodes, options.samples, options.seed, options.speeds
    )
    samples = []
    with make_robot(int(np.random.SeedSequence([options.seed, number, 1]).generate_state(1)[0])) as robot:
        for action in actions:
            reading = robot.read()
            samples.append((reading.time, robot.send(action), reading.cables, *_truth(reading, arm)))
    names = ("time", "actions", "cables", "states", "configurations")
    return {name: np.array(values) for name, values in zip(names, zip(*samples, strict=True), strict=True)}


def _truth(reading, arm: ArmSpec) -> tuple[np.ndarray, np.ndarray]:
    """True states and configurations, NaN where nothing watches."""
    states = np.full((arm.module_count, 6), np.nan) if reading.states is None else reading.states
    shapes = np.full((arm.module_count, 3), np.nan) if reading.configurations is None else reading.configurations
    return states, shapes
