"""A folder of recordings and trained networks, made when first asked for."""

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import s2c2a
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.cache import cache_folder
from s2c2a.data import CollectOptions, Recording, collect, load_recording
from s2c2a.errors import DamagedRecordingError, RecordingError, S2C2AError, StrategyError
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
class Need:
    """A file of a workshop, by all that it is made from.

    Attributes:
        kind: what it holds.
        arm: of whom.
        seed: of data and training.
        recipe: how it is made; the LSTM takes none.
        babbling: of the data.
    """

    kind: Literal["recording", "networks", "lstm"]
    arm: ArmSpec
    seed: int
    recipe: Recipe | None = None
    babbling: str = "staged"

    @property
    def data(self) -> CollectOptions:
        """Of the recording that it is, or is made from."""
        options = CollectOptions(self.babbling, seed=self.seed)
        return options if self.recipe is None else replace(options, speeds=self.recipe.speeds)


def need_of(controller: str, arm: ArmSpec, recipe: Recipe, seed: int) -> Need | None:
    """What a controller is made from; None if from nothing."""
    if controller in ("s2c2a", "s2c2a-motor"):
        return Need("networks", arm, seed, recipe, _babbling(controller))
    if controller == "lstm":
        return Need("lstm", arm, seed)
    return Need("recording", arm, seed, recipe) if controller == "pcc-fitted" else None


def _babbling(controller: str) -> str:
    return "motor" if controller == "s2c2a-motor" else "staged"


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
        path = self.recording_file(arm, options)
        with suppress(RecordingError):  # a whole one is read, never opened for writing: others may read it too
            recording = load_recording(path)
            recording.check_complete()
            return recording
        doing = f"collecting from {arm.name}, seed {options.seed}"
        collecting = partial(
            collect,
            path,
            arm,
            partial(SimulatedRobot, arm, self.fidelity),
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
        need = Need("networks", arm, seed, recipe, babbling)
        path = self.file(need)
        with suppress(StrategyError):
            return replace(load_strategy(path, arm), recipe=recipe)

        def told(network: str, epoch: int, most: int, loss: float) -> None:
            self.progress(f"training {network} of {arm.name}, {recipe.name}, seed {seed}", epoch, most)

        networks = train_s2c2a(self.recording(arm, need.data), recipe, seed, told)
        save_strategy(networks, path)
        return networks

    def lstm(self, arm: ArmSpec, seed: int) -> TrainedLSTM:
        """The trained LSTM of an arm, trained unless it was before.

        On data as fast as the paper recipe's, whatever the recipe: it follows better with them than with slower ones.
        """
        need = Need("lstm", arm, seed)
        path = self.file(need)
        with suppress(StrategyError):
            return load_lstm(path, arm)
        told = partial(self.progress, f"training the LSTM of {arm.name}, seed {seed}")
        trained = train_lstm_strategy(
            self.recording(arm, need.data), LSTMOptions(), seed, lambda epoch, most, loss: told(epoch, most)
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
            return s2c2a_strategy(self.networks(arm, recipe, seed, _babbling(controller)), guard)
        if controller == "pcc":
            return pcc_strategy(arm, planner)
        if controller == "pcc-fitted":
            return pcc_fitted_strategy(self.recording(arm, Need("recording", arm, seed, recipe).data), planner)
        if controller == "lstm":
            return LSTMStrategy(self.lstm(arm, seed))
        raise S2C2AError(f"no controller '{controller}'; choose one of {', '.join(CONTROLLERS)}")

    def make(self, need: Need) -> None:
        """Make a file, or find it."""
        if need.kind == "recording":
            self.recording(need.arm, need.data)
        elif need.kind == "lstm":
            self.lstm(need.arm, need.seed)
        elif need.recipe is not None:
            self.networks(need.arm, need.recipe, need.seed, need.babbling)

    def has(self, need: Need) -> bool:
        """Whether it is there, sound and whole."""
        path = self.file(need)
        with suppress(RecordingError, StrategyError):
            if need.kind == "recording":
                load_recording(path).check_complete()
            elif need.kind == "lstm":
                load_lstm(path, need.arm)
            else:
                load_strategy(path, need.arm)
            return True
        return False

    def file(self, need: Need) -> Path:
        """Where it is kept, made or not."""
        if need.kind == "recording":
            return self.recording_file(need.arm, need.data)
        name, trained = (
            ("lstm", asdict(LSTMOptions())) if need.recipe is None else (need.recipe.name, need.recipe.training)
        )
        return self.folder / f"{self._label(need.arm, need.data, name, trained)}.safetensors"

    def recording_file(self, arm: ArmSpec, options: CollectOptions) -> Path:
        """Where a recording is kept, made or not."""
        return self.folder / f"{self._label(arm, options)}.h5"

    def _label(self, arm: ArmSpec, options: CollectOptions, kind: str = "", trained: dict | None = None) -> str:
        """A name that is the same for the same arm, data, training and version of the code that makes them."""
        parts = [arm_to_toml(arm), asdict(options), self.fidelity, s2c2a.__version__, REVISION]
        parts += [trained] if trained else []
        digest = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:12]
        return f"{arm.name}-{f'{kind}-' if kind else ''}{options.babbling}-seed{options.seed}-{digest}"
