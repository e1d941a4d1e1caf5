"""Command `s2c2a pretrain`: a prior over randomized arms."""

from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.cli.console import Arm, RecipeName, print_held_out_errors, progress_bar
from s2c2a.cli.execution import Address, Count, make_executor
from s2c2a.execution.executors import limit_jax_to_one_thread
from s2c2a.files.text import write_atomically


def pretrain(
    out: Path,
    arm: Arm = "twin_arm",
    arms: int = 24,
    strength: float = 0.5,
    episodes: int = 4,
    samples: int = 500,
    recipe: RecipeName = "best",
    seed: int = 0,
    jobs: Count = None,
    cluster: Address = None,
    overwrite: bool = False,
) -> None:
    """Learn a prior over randomized variants of an arm, from simulation alone.

    Then `s2c2a train short.episodes --from prior.safetensors` needs few samples of the
    arm itself; the prior drives it without any. Repeat the command to continue an interrupted one.

    Args:
        out: weight file to write, such as prior.safetensors.
        arms: number of randomized arms.
        strength: magnitude of the mismatch, as in `s2c2a arm random`.
        episodes: number of episodes of each arm.
        samples: control steps per episode.
        recipe: how to train; use the same one in `train`.
        seed: random seed of the training.
        jobs: parallel processes; all cores by default.
        cluster: use the workers of a dask scheduler, see `reproduce`.
        overwrite: replace the weight file if it exists.
    """
    from s2c2a import evaluation, strategies
    from s2c2a import jobs as artifacts

    limit_jax_to_one_thread()
    strategies.check_new_networks(out, overwrite)
    chosen = strategies.recipe_from(recipe)
    nominal = chosen.seen_arm(load_arm(arm))
    prior = artifacts.PriorNetworks(
        nominal, chosen, seed, arms, strength, episodes, samples
    )
    cache = artifacts.Cache()
    with make_executor(jobs, cluster) as executor, progress_bar() as progress:
        if not prior.is_in(cache):
            artifacts.make_all(prior.needs, cache, executor, progress)
            # in this process, which shows the progress of the training
            prior.make(cache, progress)
        networks = prior.load(cache)
    write_atomically(prior.path(cache).read_bytes(), out)
    title = f"Held-out errors over {arms} arms, in percent of the full range"
    print_held_out_errors(title, networks)
    if text := evaluation.describe_modal_model(networks):
        print(text)
    print(f"prior: {out}")
