"""`s2c2a collect`: a recording of an arm."""

from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Literal

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, FidelityName, RecipeName, progress_bar
from s2c2a.cli.execution import Address, RobotName, RobotOptions, body_for, executor_for
from s2c2a.errors import S2C2AError


def collect(
    out: Path,
    arm: Arm = "twin_arm",
    babbling: Literal["staged", "motor", "mixed"] | None = None,
    episodes: int | None = None,
    samples: int = 500,
    seed: int = 0,
    recipe: RecipeName = "best",
    robot: RobotName = "sim",
    robot_option: RobotOptions = (),
    fidelity: FidelityName = "fast",
    threads: int | None = None,
    cluster: Address = None,
    resume: bool = False,
    overwrite: bool = False,
) -> None:
    """Collect a recording from an arm, and draw its workspace beside it.

    Args:
        out: the recording to write, such as twin.episodes.
        arm: a preset or an arm file.
        babbling: staged as in the paper, each module its own way (motor), or all
            between (mixed); the recipe's if not stated.
        episodes: number of episodes, each from rest; the recipe's if not stated.
        samples: control steps in an episode.
        seed: of everything random.
        recipe: says how to babble, how fast, and in how many episodes; train with the
            same one.
        robot: what is driven: the simulated arm, or a class of your own such as
            my_arm.py:MyArm.
        robot_option: what that class takes beside the arm.
        fidelity: of the simulation.
        threads: episodes side by side; all cores if not stated. The recording is the
            same.
        cluster: let the workers of a dask scheduler do it: its address
            (tcp://host:8786, or the file where it wrote it), or local for one on this
            machine; docs/cluster.md. The recording is the same.
        resume: go on with a recording that was cut short.
        overwrite: replace the recording if it exists.
    """
    from s2c2a import data, strategies, viz

    spec = load_arm(arm)
    chosen = strategies.recipe_from(recipe)
    body = body_for(robot, robot_option, fidelity)
    options = chosen.collect_options(seed)
    how = babbling or options.babbling
    often = options.episodes if episodes is None else episodes
    options = replace(options, babbling=how, episodes=often, samples=samples)
    if not body.simulated:
        if cluster or threads not in (None, 1):
            raise S2C2AError(
                f"{body} is one arm and does one episode at a time; leave out --threads and --cluster"
            )
        threads = 1
    with (
        executor_for(threads, cluster) if cluster else nullcontext() as executor,
        progress_bar() as progress,
    ):
        told = partial(progress, f"collecting from {spec.name}")
        driven = partial(
            data.collect,
            executor=executor,
            threads=threads,
            body=str(body),
            progress=told,
        )
        recording = driven(
            out,
            spec,
            partial(body.seeded, spec),
            options,
            resume=resume,
            overwrite=overwrite,
        )
    said = f"{recording.time.size} samples of {', '.join(recording.sensors)}: {out}"
    if "states" in recording.sensors:
        states = recording.sensor("states").reshape(-1, spec.module_count, 6)
        said += f"; workspace: {viz.recording_figure(states, spec, Path(f'{out}.png'))}"
    print(said)
