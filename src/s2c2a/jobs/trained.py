"""What strategies are made from: recordings of the simulated arm, and networks that are trained on them."""

import hashlib
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.data import CollectOptions, Recording, collect, load_recording
from s2c2a.episodes.file import ENDING
from s2c2a.errors import DamagedRecordingError
from s2c2a.files import save_whole
from s2c2a.jobs.artifacts import Artifact, Cache, digest_of
from s2c2a.progress import Progress
from s2c2a.robots import Body, Robot
from s2c2a.strategies import (
    LSTMOptions,
    Recipe,
    TrainedLSTM,
    TrainedNetworks,
    load_lstm,
    load_strategy,
    planning_as,
    save_lstm,
    save_strategy,
    train_lstm_strategy,
    train_s2c2a,
)

DATA = Body()
"""Data always come from the simulation `fast`."""


@dataclass(frozen=True)
class RecordingArtifact(Artifact[Recording]):
    """A recording of the simulated arm; one that was cut short in this folder is gone on with."""

    kind = "recordings"
    arm: ArmSpec
    options: CollectOptions

    @property
    def needs(self) -> tuple[()]:
        """Nothing."""
        return ()

    @property
    def file(self) -> str:
        """See `Artifact`."""
        digest = digest_of("recording", arm_to_toml(self.arm), self.options, DATA)
        return f"{self.arm.name}-{self.options.babbling}-seed{self.options.seed}-{digest}{ENDING}"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        robot, told = partial(_robot, self.arm), partial(progress, f"collecting a {self}")
        options: dict[str, Any] = {"body": str(DATA), "threads": cache.threads, "progress": told}
        collecting = partial(collect, self.path(cache), self.arm, robot, self.options, **options)
        try:
            collecting(resume=True)
        except DamagedRecordingError:  # ours to replace
            collecting(overwrite=True)

    def load(self, cache: Cache) -> Recording:
        """See `Artifact`; a whole one is never opened for writing, for others may read it too."""
        recording = load_recording(self.path(cache))
        recording.check_complete()
        return recording

    def __str__(self) -> str:
        return f"recording of {self.arm.name}, {self.options.babbling}, seed {self.options.seed}"


def _robot(arm: ArmSpec, seed: int) -> Robot:
    return DATA.make(arm, seed=seed)


@dataclass(frozen=True)
class NetworksArtifact(Artifact[TrainedNetworks]):
    """Both networks of an arm; kept by what training depends on, so that a change of the planner trains nothing."""

    kind = "networks"
    arm: ArmSpec
    recipe: Recipe
    seed: int
    babbling: str = "staged"

    @property
    def needs(self) -> tuple[RecordingArtifact]:
        """Their recording."""
        return (RecordingArtifact(self.arm, CollectOptions(self.babbling, seed=self.seed, speeds=self.recipe.speeds)),)

    @property
    def file(self) -> str:
        """See `Artifact`."""
        digest = digest_of(self.needs[0].file, self.recipe.training)
        return f"{self.arm.name}-{self.recipe.name}-{self.babbling}-seed{self.seed}-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""

        def told(network: str, epoch: int, most: int, loss: float) -> None:
            progress(f"training {network} of {self}", epoch, most)

        recording = self.needs[0].load(cache)
        save_strategy(train_s2c2a(recording, self.recipe, self.seed, told), self.path(cache))

    def load(self, cache: Cache) -> TrainedNetworks:
        """See `Artifact`."""
        return replace(load_strategy(self.path(cache), self.arm), recipe=self.recipe)

    def __str__(self) -> str:
        return f"{self.recipe.name} networks of {self.arm.name}, seed {self.seed}"


@dataclass(frozen=True)
class LSTMArtifact(Artifact[TrainedLSTM]):
    """The trained LSTM of an arm.

    On data as fast as the paper recipe's, whatever the recipe: it follows better with them than with slower ones.
    """

    kind = "networks"
    arm: ArmSpec
    seed: int

    @property
    def needs(self) -> tuple[RecordingArtifact]:
        """Its recording."""
        return (RecordingArtifact(self.arm, CollectOptions(seed=self.seed)),)

    @property
    def file(self) -> str:
        """See `Artifact`."""
        digest = digest_of(self.needs[0].file, LSTMOptions())
        return f"{self.arm.name}-lstm-seed{self.seed}-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""

        def told(epoch: int, most: int, loss: float) -> None:
            progress(f"training the {self}", epoch, most)

        recording = self.needs[0].load(cache)
        save_lstm(train_lstm_strategy(recording, LSTMOptions(), self.seed, told), self.path(cache))

    def load(self, cache: Cache) -> TrainedLSTM:
        """See `Artifact`."""
        return load_lstm(self.path(cache), self.arm)

    def __str__(self) -> str:
        return f"LSTM of {self.arm.name}, seed {self.seed}"


@dataclass(frozen=True)
class GivenNetworks(Artifact[TrainedNetworks]):
    """Networks of a file of the user's, kept with the runs that are made with them; read one with `read`."""

    kind, beside_runs = "networks", True
    arm: ArmSpec
    recipe: Recipe
    content: bytes = field(repr=False)

    @classmethod
    def read(cls, path: Path, arm: ArmSpec, recipe: Recipe | None = None) -> "GivenNetworks":
        """Those of a strategy file, to plan as a recipe says, or as the file's own.

        Raises:
            StrategyError: no such file, damaged, for another arm, or the recipe trains otherwise.
        """
        networks = load_strategy(path, arm)
        return cls(arm, planning_as(networks, recipe or networks.recipe).recipe, path.read_bytes())

    @property
    def needs(self) -> tuple[()]:
        """Nothing."""
        return ()

    @property
    def file(self) -> str:
        """See `Artifact`."""
        return f"weights-{hashlib.sha256(self.content).hexdigest()[:16]}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        save_whole(self.content, self.path(cache))

    def load(self, cache: Cache) -> TrainedNetworks:
        """See `Artifact`."""
        return planning_as(load_strategy(self.path(cache), self.arm), self.recipe)

    def __str__(self) -> str:
        return f"given networks of {self.arm.name}"
