"""Make the project's reference data set: recordings of simulated arms, with a card.

Run `python -m tools.make_reference_data --out FOLDER`. Repeat the command to continue an
interrupted collection. The recordings are deterministic for each version.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path

import tyro

from s2c2a.arm import ArmSpec, load_arm, save_arm
from s2c2a.arm.randomized import randomized_arm
from s2c2a.cli.console import progress_bar
from s2c2a.data import collect
from s2c2a.execution.versions import versions
from s2c2a.files.text import write_atomically
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import recipe_named

PRESETS = ("twin_arm", "simulated_arm")
RANDOMIZED = ((0.5, (0, 1, 2, 3)), (1.0, (0, 1)))
"""Strengths of the model mismatch, and seeds of the arms."""
CARD = """# Reference recordings of simulated arms

**What.** Random motion of {count} simulated arms, as the recipe `{recipe}` collects it:
{episodes} episodes of {samples} control steps for each arm, seed {seed}. `twin_arm` and
`simulated_arm` are presets; `twin_arm_50_N` and `twin_arm_100_N` are `twin_arm` with
random model mismatch of strength 0.5 and 1.

**License.** MIT, as S2C2A.

**Source.** `python -m tools.make_reference_data --seed {seed}`; versions: {versions}.

**Columns.** `.episodes` files of S2C2A (safetensors), read by
`s2c2a.data.load_recording`. An episode has `states` (steps, modules, 6) [m, unit
vector], `configurations` (steps, modules, 3) [unit vector], `actions` (steps, modules,
cables) [m, or N with tension control], and the readings of the sensors;
`docs/reference/episodes.md` describes them. `ARM.toml` describes the arm with its
mismatch, which controllers do not know.

| recording | SHA-256 |
| --- | --- |
{files}
"""


def reference_arms() -> list[ArmSpec]:
    """Presets and randomized arms of the set."""
    base = load_arm("twin_arm")
    randomized = [
        randomized_arm(base, seed, strength)
        for strength, seeds in RANDOMIZED
        for seed in seeds
    ]
    return [*map(load_arm, PRESETS), *randomized]


def make_reference_data(
    out: Path,
    seed: int = 0,
    episodes: int | None = None,
    samples: int | None = None,
    recipe: str = "best",
) -> None:
    """Collect from all arms and write the card.

    Args:
        out: folder of the data set.
        seed: of the motion.
        episodes: number of episodes of each arm, by default that of the recipe.
        samples: control steps of an episode, by default those of the recipe.
        recipe: the kind of motion.
    """
    options = recipe_named(recipe).collect_options(seed)
    if episodes is not None:
        options = replace(options, episodes=episodes)
    if samples is not None:
        options = replace(options, samples=samples)
    out.mkdir(parents=True, exist_ok=True)
    arms = reference_arms()
    for arm in arms:
        with progress_bar() as progress:
            collect(
                out / f"{arm.name}.episodes",
                arm,
                partial(_simulated, arm),
                options,
                robot="simulation fast",
                resume=True,
                progress=partial(progress, f"collecting from {arm.name}"),
            )
        save_arm(arm, out / f"{arm.name}.toml", overwrite=True)
    card = CARD.format(
        count=len(arms),
        recipe=recipe,
        episodes=options.episodes,
        samples=options.samples,
        seed=seed,
        versions=", ".join(f"{name} {number}" for name, number in versions().items()),
        files="\n".join(_file_lines(out, arms)),
    )
    write_atomically(card.encode(), out / "README.md")


def _simulated(arm: ArmSpec, seed: int) -> SimulatedRobot:
    return SimulatedRobot(arm, seed=seed)


def _file_lines(out: Path, arms: Sequence[ArmSpec]) -> list[str]:
    """Lines of the card: every recording with its digest."""
    names = [f"{arm.name}.episodes" for arm in arms]
    return [
        f"| `{name}` | `{sha256((out / name).read_bytes()).hexdigest()}` |"
        for name in names
    ]


if __name__ == "__main__":
    tyro.cli(make_reference_data)
