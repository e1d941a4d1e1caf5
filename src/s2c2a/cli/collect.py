"""Command `s2c2a collect`: record an arm."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, Count, FidelityName, RecipeName, progress_bar
from s2c2a.cli.emergency import emergency_controls
from s2c2a.cli.execution import (
    Address,
    RobotName,
    RobotOptions,
    TrackingSource,
    check_parallel,
    make_executor,
    robot_factory_for,
)
from s2c2a.errors import counted

if TYPE_CHECKING:
    from s2c2a import data


def collect(
    out: Path,
    arm: Arm = "twin_arm",
    babbling: Literal["staged", "motor", "coverage"] | None = None,
    episodes: Count = None,
    samples: int = 500,
    seed: int = 0,
    recipe: RecipeName = "best",
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    tracking: TrackingSource = "",
    fidelity: FidelityName = "fast",
    threads: Count = None,
    cluster: Address = None,
    resume: bool = False,
    overwrite: bool = False,
) -> None:
    """Record random motion of an arm (babbling), and plot what it covers.

    Args:
        out: the recording, such as twin.episodes.
        babbling: staged as in the paper, independent modules (motor), or targets that
            cover the configurations of plans (coverage); default from the recipe.
        episodes: number of episodes, each from rest; default from the recipe.
        samples: control steps per episode.
        seed: random seed.
        recipe: sets the type of babbling, the speeds and the number of episodes; use
            the same one in `train`.
        threads: parallel episodes, all cores by default; the recording is the same.
        cluster: use the workers of a dask scheduler: its address (tcp://host:8786, or
            its scheduler file), or local for one on this machine; docs/guides/cluster.md. The
            recording is the same.
        resume: continue an interrupted recording.
        overwrite: replace the recording if it exists.
    """
    spec = load_arm(arm)
    factory = robot_factory_for(robot, robot_option, fidelity, tracking=tracking)
    check_parallel(factory, threads, cluster, "--threads")
    with (
        make_executor(threads, cluster) if cluster else nullcontext() as executor,
        progress_bar() as progress,
        emergency_controls(factory),
    ):
        on_progress = partial(progress, f"collecting from {spec.name}")
        on_progress(0, episodes or 1)  # before a slow import
        from s2c2a import api

        recording = api.collect(
            spec,
            out,
            episodes=episodes,
            samples=samples,
            seed=seed,
            recipe=recipe,
            babbling=babbling,
            robot=factory,
            resume=resume,
            overwrite=overwrite,
            threads=threads,
            executor=executor,
            progress=on_progress,
        )
    _print_summary(recording, out)


def _print_summary(recording: "data.Recording", out: Path) -> None:
    from s2c2a import data, evaluation, viz
    from s2c2a.cli.console import draw_coverage

    sensors = ", ".join(recording.sensors)
    texts = [f"{counted(recording.time.size, 'sample')} of {sensors}: {out}"]
    if coverage := draw_coverage(recording, out):
        texts.append(f"coverage: {coverage}")
    arm = recording.arm
    actions = np.concatenate([episode["actions"] for episode in recording.episodes])
    texts.append(evaluation.describe_saturation(arm, actions))
    if "states" in recording.sensors:
        states = recording.sensor("states").reshape(-1, arm.module_count, 6)
        picture = viz.recording_figure(states, arm, Path(f"{out}.png"))
        texts += [
            f"workspace: {picture}",
            evaluation.describe_lost_states(states),
            evaluation.describe_jumps_of_frame(recording.episodes),
            data.describe_excluded(recording),
        ]
    else:
        texts.append(
            "without true states (tracking), no networks can be trained from it"
        )
    print("; ".join(filter(None, texts)))
