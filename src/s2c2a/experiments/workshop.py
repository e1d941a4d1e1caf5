"""A folder of recordings and trained networks, made when first asked for."""

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import s2c2a
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.cache import cache_folder
from s2c2a.data import CollectOptions, Recording, collect
from s2c2a.errors import DamagedRecordingError, S2C2AError, StrategyError
from s2c2a.planning.options import Guard
from s2c2a.robots.simulation import SimulatedRobot
from s2c2a.strategies import (
    AnyStrategy,
    LSTMOptions,
    LSTMStrategy,
    Recipe,
    TrainedLSTM,
    TrainedNetworks,
    load_lstm,
    load_strategy,
    pcc_fitted_strategy,
    pcc_strategy,
    s2c2a_strategy,
    save_lstm,
    save_strategy,
    train_lstm_strategy,
    train_s2c2a,
)

Progress = Callable[[str, int, int], None]
"""Told what is being done, how many parts of it are done, and how many there are."""

REVISION = 2
"""Raise it whenever simulation, babbling, training or file layout change what is kept, so that nothing old is used."""

CONTROLLERS = ("s2c2a", "pcc", "pcc-fitted", "lstm", "s2c2a-motor")
"""The strategy, its comparisons, and the strategy trained on motor babbling (Chen et al. 2025, sec. IV)."""


def quiet(doing: str, done: int, total: int) -> None:
    """A progress that tells nobody."""


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

    def networks(self, arm: ArmSpec, recipe: Recipe, seed: int, babbling: str = "staged") -> TrainedNetworks:
        """Trained networks of an arm, trained unless they were before."""
        options = CollectOptions(babbling, seed=seed, speeds=recipe.speeds)
        path = self.folder / f"{self._label(arm, options, recipe.name, recipe.training)}.safetensors"
        with suppress(StrategyError):
            return replace(load_strategy(path, arm), recipe=recipe)

        def told(network: str, epoch: int, most: int, loss: float) -> None:
            self.progress(f"training {network} of {arm.name}, seed {seed}", epoch, most)

        networks = train_s2c2a(self.recording(arm, options), recipe, seed, told)
        save_strategy(networks, path)
        return networks

    def lstm(self, arm: ArmSpec, seed: int) -> TrainedLSTM:
        """The trained LSTM of an arm, trained unless it was before.

        On data as fast as the paper recipe's, whatever the recipe: it follows better with them than with slower ones.
        """
        options, size = CollectOptions(seed=seed), LSTMOptions()
        path = self.folder / f"{self._label(arm, options, 'lstm', asdict(size))}.safetensors"
        with suppress(StrategyError):
            return load_lstm(path, arm)
        told = partial(self.progress, f"training the LSTM of {arm.name}, seed {seed}")
        trained = train_lstm_strategy(
            self.recording(arm, options), size, seed, lambda epoch, most, loss: told(epoch, most)
        )
        save_lstm(trained, path)
        return trained

    def strategy(self, controller: str, arm: ArmSpec, recipe: Recipe, seed: int, guard: Guard = "tip") -> AnyStrategy:
        """A strategy by name, with whatever it needs.

        Raises:
            S2C2AError: no such controller.
        """
        planner = replace(recipe.planner, guard=guard)
        if controller in ("s2c2a", "s2c2a-motor"):
            babbling = "motor" if controller == "s2c2a-motor" else "staged"
            return s2c2a_strategy(self.networks(arm, recipe, seed, babbling), guard)
        if controller == "pcc":
            return pcc_strategy(arm, planner)
        if controller == "pcc-fitted":
            return pcc_fitted_strategy(self.recording(arm, CollectOptions(seed=seed, speeds=recipe.speeds)), planner)
        if controller == "lstm":
            return LSTMStrategy(self.lstm(arm, seed))
        raise S2C2AError(f"no controller '{controller}'; choose one of {', '.join(CONTROLLERS)}")

    def _label(self, arm: ArmSpec, options: CollectOptions, kind: str = "", trained: dict | None = None) -> str:
        """A name that is the same for the same arm, data, training and version of the code that makes them."""
        parts = [arm_to_toml(arm), asdict(options), self.fidelity, s2c2a.__version__, REVISION]
        parts += [trained] if trained else []
        digest = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:12]
        return f"{arm.name}-{f'{kind}-' if kind else ''}{options.babbling}-seed{options.seed}-{digest}"
