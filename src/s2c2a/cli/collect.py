"""`s2c2a collect`: a recording of an arm."""

from contextlib import nullcontext
from pathlib import Path
from typing import Literal

from s2c2a.cli.console import Arm, FidelityName, RecipeName, progress_bar
from s2c2a.cli.crews import Address, crew_for


def collect(
    out: Path,
    arm: Arm = "twin_arm",
    babbling: Literal["staged", "motor"] = "staged",
    episodes: int = 18,
    samples: int = 500,
    seed: int = 0,
    recipe: RecipeName = "best",
    fidelity: FidelityName = "fast",
    threads: int | None = None,
    cluster: Address = None,
    resume: bool = False,
    overwrite: bool = False,
) -> None:
    """Collect a recording from the simulated arm, and draw its workspace beside it.

    Args:
        out: the recording to write, such as twin.h5.
        arm: a preset or an arm file.
        babbling: staged as in the paper, or plain motor babbling.
        episodes: number of episodes, each from rest.
        samples: control steps in an episode.
        seed: of everything random.
        recipe: says how fast to babble; train with the same one.
        fidelity: of the simulation.
        threads: episodes side by side; all cores if not stated. The recording is the same.
        cluster: let its workers drive the episodes. The recording is the same.
        resume: go on with a recording that was cut short.
        overwrite: replace the recording if it exists.
    """
    from functools import partial

    from s2c2a.arm import load_arm
    from s2c2a.data import CollectOptions
    from s2c2a.data import collect as collect_recording
    from s2c2a.robots.simulation import SimulatedRobot
    from s2c2a.strategies import recipe_from
    from s2c2a.viz import recording_figure

    spec, chosen = load_arm(arm), recipe_from(recipe)
    with crew_for(threads, cluster) if cluster else nullcontext() as crew, progress_bar() as progress:
        recording = collect_recording(
            out,
            spec,
            partial(SimulatedRobot, spec, fidelity),
            CollectOptions(babbling, episodes, samples, seed, chosen.speeds),
            body=f"simulation {fidelity}",
            threads=threads,
            crew=crew,
            resume=resume,
            overwrite=overwrite,
            progress=lambda done, total: progress(f"collecting from {spec.name}", done, total),
        )
    picture = recording_figure(recording.states.reshape(-1, spec.module_count, 6), Path(f"{out}.png"))
    print(f"{recording.time.size} samples: {out}; workspace: {picture}")
