"""A folder of recordings and trained networks, made when first asked for."""

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import platformdirs

import s2c2a
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.errors import DamagedRecordingError, S2C2AError, StrategyError
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import (
    Recipe,
    Strategy,
    TrainedNetworks,
    load_strategy,
    pcc_fitted_strategy,
    pcc_strategy,
    s2c2a_strategy,
    save_strategy,
    train_s2c2a,
)

Progress = Callable[[str, int, int], None]
"""Told what is being done, how many parts of it are done, and how many there are."""

REVISION = 1
"""Raise it whenever simulation, babbling, training or file layout change what is kept, so that nothing old is used."""

CONTROLLERS = ("s2c2a", "pcc", "pcc-fitted")


def quiet(doing: str, done: int, total: int) -> None:
    """A progress that tells nobody."""


def cache_folder() -> Path:
    """Where recordings and networks are kept between runs; safe to delete. `S2C2A_CACHE` moves it."""
    return Path(os.environ.get("S2C2A_CACHE") or platformdirs.user_cache_dir("s2c2a"))


@dataclass(frozen=True)
class Workshop:
    """Makes what a strategy needs, or finds it where it was made before.

    Attributes:
        folder: where recordings and networks are kept.
        fidelity: of the simulation that data come from.
        progress: told of long work.
        threads: for collecting; all cores if None.
    """

    folder: Path = field(default_factory=cache_folder)
    fidelity: str = "fast"
    progress: Progress = quiet
    threads: int | None = None

    def recording(self, arm: ArmSpec, options: CollectOptions) -> Recording:
        """A recording of the simulated arm, collected or continued unless it is whole already."""
        path = self.folder / f"{self._label(arm, options)}.h5"
        doing = f"collecting from {arm.name}, seed {options.seed}"
        collecting = partial(
            collect,
            path,
            arm,
            lambda seed: SimulatedRobot(arm, self.fidelity, seed),
            options,
            body=f"simulation {self.fidelity}",
            threads=self.threads,
            progress=partial(self.progress, doing),
        )
        try:
            return collecting(resume=True)
        except DamagedRecordingError:  # ours to replace
            return collecting(overwrite=True)

    def networks(self, arm: ArmSpec, recipe: Recipe, seed: int) -> TrainedNetworks:
        """Trained networks of an arm, trained unless they were before."""
        options = CollectOptions(seed=seed)
        path = self.folder / f"{self._label(arm, options, recipe)}.safetensors"
        try:
            return load_strategy(path, arm)
        except StrategyError:
            pass
        recording = self.recording(arm, options)

        def told(network: str, epoch: int, most: int, loss: float) -> None:
            self.progress(f"training {network} of {arm.name}, seed {seed}", epoch, most)

        networks = train_s2c2a(recording, recipe, seed, told)
        save_strategy(networks, path)
        return networks

    def strategy(self, controller: str, arm: ArmSpec, recipe: Recipe, seed: int) -> Strategy:
        """A strategy by name, with whatever it needs.

        Raises:
            S2C2AError: no such controller.
        """
        if controller == "s2c2a":
            return s2c2a_strategy(self.networks(arm, recipe, seed))
        if controller == "pcc":
            return pcc_strategy(arm, recipe.planner)
        if controller == "pcc-fitted":
            return pcc_fitted_strategy(self.recording(arm, CollectOptions(seed=seed)), recipe.planner)
        raise S2C2AError(f"no controller '{controller}'; choose one of {', '.join(CONTROLLERS)}")

    def _label(self, arm: ArmSpec, options: CollectOptions, recipe: Recipe | None = None) -> str:
        """A name that is the same for the same arm, data, recipe and version of the code that makes them."""
        parts = [arm_to_toml(arm), asdict(options), self.fidelity, s2c2a.__version__, REVISION]
        parts += [asdict(recipe)] if recipe else []
        digest = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:12]
        kind = f"-{recipe.name}" if recipe else f"-{options.babbling}"
        return f"{arm.name}{kind}-seed{options.seed}-{digest}"
