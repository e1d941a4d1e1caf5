"""Make the small recording and the small networks in `tests/fixtures/` again.

Tests read them instead of collecting and training: `python -m tools.small_networks`
writes them anew after a change of their format or of what is trained.
"""

from dataclasses import replace
from pathlib import Path

from s2c2a.arm import load_arm
from s2c2a.control.options import C2AOptions
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.models import C2SOptions, ChainOptions
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import recipe_named, save_networks, train_s2c2a
from s2c2a.training import FitOptions

FOLDER = Path(__file__).parents[1] / "tests" / "fixtures"
RECORDING, PAPER, BEST = (
    FOLDER / "twin.episodes",
    FOLDER / "paper.safetensors",
    FOLDER / "best.safetensors",
)
SEED = 7
COLLECTION = CollectOptions(episodes=6, samples=100)
QUICK = FitOptions(learning_rate=1e-2, max_epochs=12, epochs_per_call=6)
CONTROLLER = C2AOptions(layers=1, hidden=8)
PAPER_RECIPE = replace(
    recipe_named("paper"),
    name="tiny",
    c2s=C2SOptions(1, 8),
    c2a=CONTROLLER,
    c2s_fit=QUICK,
    c2a_fit=QUICK,
)
BEST_RECIPE = replace(
    recipe_named("best"),
    name="tiny_best",
    c2s=ChainOptions(hidden=8, depth=1, play_widths=(0.005, 0.02), creep_times=(1.0,)),
    c2a=CONTROLLER,
    c2s_fit=replace(QUICK, decay=True),
    c2a_fit=replace(QUICK, decay=True),
)


def make_recording(path: Path) -> Recording:
    """Collect six short episodes of the twin."""
    twin = load_arm("twin_arm")
    return collect(
        path,
        twin,
        lambda seed: SimulatedRobot(twin, seed=seed),
        COLLECTION,
        robot="simulation fast",
        overwrite=True,
    )


def main() -> None:
    """Write the recording, and the networks that are trained on it."""
    FOLDER.mkdir(exist_ok=True)
    recording = make_recording(RECORDING)
    for recipe, path in ((PAPER_RECIPE, PAPER), (BEST_RECIPE, BEST)):
        save_networks(train_s2c2a(recording, recipe, seed=SEED), path)


if __name__ == "__main__":
    main()
