"""Collecting a recording: episodes side by side, written in order, resumable, each driven by the loop that runs use."""

import os
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from s2c2a.arm import ArmGeometry, ArmSpec
from s2c2a.data.babbling import BABBLING, SPEEDS, episode_actions, fastest
from s2c2a.data.recording import Recording, load_recording
from s2c2a.episodes import Episode, EpisodeWriter
from s2c2a.errors import RecordingError
from s2c2a.executors import Serial, Threads, in_order
from s2c2a.goals import Goal
from s2c2a.robots import Robot
from s2c2a.runtime import Ask, CommandLimits, Loop, episode_of
from s2c2a.spaces import Actions, Reading, Stage

MAX_EPISODES = 100_000
MAX_SAMPLES = 100_000
MAX_SEED = 2**63
STEP_LIMIT_DEG = 4.0  # of the arms that speeds were chosen on
MakeRobot = Callable[[int], Robot]


@dataclass(frozen=True)
class CollectOptions:
    """How to collect.

    Attributes:
        babbling: one of `BABBLING`.
        episodes: number of episodes, each from rest.
        samples: control steps in an episode.
        seed: of everything random.
        speeds: slowest and fastest approach of a bend target, as part of the full bend
            per step, of an arm with a step limit of 4 deg; of others in proportion, for
            what they may do in a step they shall have tried.
    """

    babbling: str = "staged"
    episodes: int = 18
    samples: int = 500
    seed: int = 0
    speeds: tuple[float, float] = SPEEDS

    def __post_init__(self):
        if self.babbling not in BABBLING:
            raise RecordingError(
                f"no babbling '{self.babbling}'; choose one of {', '.join(BABBLING)}"
            )
        if not (
            1 <= self.episodes <= MAX_EPISODES and 1 <= self.samples <= MAX_SAMPLES
        ):
            raise RecordingError(
                f"{self.episodes} episodes of {self.samples} samples asked for; both must be positive, and at most "
                f"{MAX_EPISODES} and {MAX_SAMPLES}"
            )
        if not 0 <= self.seed <= MAX_SEED or any(
            count % 1 for count in (self.episodes, self.samples, self.seed)
        ):
            raise RecordingError(
                f"seed {self.seed} asked for; it must be whole, as counts are, and not negative"
            )
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
    executor: Executor | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Recording:
    """Collect a recording, the same whoever drives its episodes and however often it was killed and resumed.

    Args:
        path: the file to write.
        arm: the arm to drive.
        make_robot: a robot for the episode of the given seed; called once an episode,
            in its thread.
        options: how to babble.
        body: what the robot is, kept with the recording, such as "simulation fast".
        threads: episodes side by side; all cores if not stated. A real arm takes one.
        executor: who drives the episodes, if not threads of this process; where it has
            others, `make_robot` has to travel, as a `partial` of a class does and a
            lambda does not.
        resume: go on with a file that has fewer episodes than asked for.
        overwrite: begin anew where a file exists.
        progress: told how many episodes of how many are whole.

    Raises:
        RecordingError: the file exists and neither `resume` nor `overwrite` was asked
            for, it was begun otherwise, or it cannot be written.
    """
    if threads is not None and threads < 1:
        raise RecordingError(
            f"{threads} threads asked for; take at least one, or leave it out for all cores"
        )
    drive = partial(_episode, arm, make_robot, options)
    # of a real arm nothing is begun before the last episode is safe
    workers = (
        nullcontext(executor)
        if executor
        else Serial()
        if threads == 1
        else Threads(threads)
    )
    with closing(
        _open_writer(
            Path(path), arm, _as_written(options) | {"body": body}, resume, overwrite
        )
    ) as writer:
        progress(writer.count, options.episodes)
        with workers as driving:
            for episode in in_order(
                driving, drive, range(writer.count, options.episodes)
            ):
                writer.append(episode)
                progress(writer.count, options.episodes)
    return load_recording(path)


def _as_written(options: CollectOptions) -> dict:
    """Options as they stand in a file: one number or word each."""
    written = asdict(options)
    slowest, fastest = written.pop("speeds")
    return written | {"slowest": slowest, "fastest": fastest}


def _open_writer(
    path: Path, arm: ArmSpec, options: dict, resume: bool, overwrite: bool
) -> EpisodeWriter:
    if not path.exists() or overwrite:
        return EpisodeWriter.create(path, arm, options)
    if not resume:
        raise RecordingError(
            f"{path} exists; go on with it (--resume), begin anew (--overwrite), or take another name"
        )
    writer = EpisodeWriter(path)
    begun = writer.options
    differing = [
        f"{key} {begun.get(key)!r}, now {new!r}"
        for key, new in options.items()
        if begun.get(key) != new
    ]
    differing += ["arm"] if writer.arm != arm else []
    if differing:
        writer.close()
        raise RecordingError(
            f"{path} was begun with another arm or other options ({'; '.join(differing)}); "
            "resume it as begun, or overwrite it (--overwrite)"
        )
    return writer


class Player:
    """Actions that were chosen before, one a step; it needs everything that the body says, since all is recorded."""

    def __init__(self, arm: ArmSpec, sensors: tuple[str, ...], actions: np.ndarray):
        self.arm = arm
        self.sensors = sensors
        self._actions = actions

    def start(self, reading: Reading) -> None:
        """From the first one."""
        self._left = iter(self._actions)

    def step(self, reading: Reading, goal: Goal) -> Actions:
        """The next one."""
        return next(self._left)

    def sent(self, action: Actions) -> None:
        """It goes on with the next one."""

    def diagnostics(self) -> dict:
        """It makes nothing of what it reads."""
        return {}


def _episode(
    arm: ArmSpec, make_robot: MakeRobot, options: CollectOptions, number: int
) -> Episode:
    """Drive the arm through one episode, and back to rest.

    Raises:
        RecordingError: a sensor could not be believed; the arm is at rest, and the
            episode is not kept.
    """
    speeds = _speeds(arm, options)
    actions = episode_actions(
        ArmGeometry.of(arm),
        options.babbling,
        number,
        options.episodes,
        options.samples,
        options.seed,
        speeds,
    )
    robot = make_robot(
        int(np.random.SeedSequence([options.seed, number, 1]).generate_state(1)[0])
    )
    # one of metal keeps its own, whatever babbles
    limits = _limits(arm, options) if robot.own_time else None
    with Loop(robot, Player(arm, _needed(robot), actions), limits=limits) as loop:
        steps = []
        for _ in actions:
            steps.append(loop.tick(Ask()))
            if steps[-1].stage is not Stage.RUN:
                raise RecordingError(
                    f"episode {number + 1}, step {len(steps)}: {loop.fault}; mend that, then go on (--resume)"
                )
        whole = episode_of(steps, arm)
    timeless = {
        name: values for name, values in whole.columns.items() if name != "tick_time"
    }
    # a recording is the same to the last byte, wherever it is made
    return replace(whole, columns=timeless)


def _needed(robot: Robot) -> tuple[str, ...]:
    """Sensors without which there is no sample."""
    return tuple(name for name, sensor in robot.sensors.items() if sensor.always)


def _speeds(arm: ArmSpec, options: CollectOptions) -> tuple[float, float]:
    """For an arm that may go so far in a step."""
    slowest, fastest = (
        min(speed * arm.step_limit_deg / STEP_LIMIT_DEG, 1.0)
        for speed in options.speeds
    )
    return slowest, fastest


def _limits(arm: ArmSpec, options: CollectOptions) -> CommandLimits:
    """As fast as the babbling is meant to be, and its corners as sharp."""
    share = fastest(options.babbling, arm.module_count, _speeds(arm, options))
    most = share * np.rad2deg(ArmGeometry.of(arm).action_bends.max()) * (1 + 1e-6)
    return CommandLimits.with_steps(arm, most, 2 * most)
