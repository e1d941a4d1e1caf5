"""Artifacts: what is made once, kept in a folder, and found again by all that it depends on.

Recordings of the simulated arm, networks that are trained on them, and those of a file
of the user's.
"""

import hashlib
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

import s2c2a
from s2c2a import strategies
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.cache import cache_folder
from s2c2a.data import CollectOptions, Recording, collect, load_recording
from s2c2a.episodes.file import ENDING
from s2c2a.errors import DamagedRecordingError, S2C2AError
from s2c2a.files import save_whole
from s2c2a.progress import Progress
from s2c2a.robots import Body
from s2c2a.strategies import LSTMOptions, Recipe, TrainedLSTM, TrainedNetworks

REVISION = 5
"""Raise it whenever simulation, babbling, training or file layout change what is kept,
so that nothing old is used."""

DATA = Body.simulation()
"""Data always come from the simulation `fast`."""

Made = TypeVar("Made")


@dataclass(frozen=True)
class Cache:
    """A folder of recordings and networks, and one of finished runs; all in them is safe to delete.

    Attributes:
        folder: of recordings and networks.
        runs_in: folder of finished runs, if not beside them.
        threads: for collecting; all cores if None.
    """

    folder: Path = field(default_factory=cache_folder)
    runs_in: Path | None = None
    threads: int | None = None

    @property
    def runs(self) -> Path:
        """Folder of finished runs."""
        return self.runs_in or self.folder / "runs"


class Artifact(ABC, Generic[Made]):
    """A frozen key: equal ones are the same file, wherever it is made.

    Attributes:
        kind: what such artifacts are called, for progress.
        beside_runs: whether it is kept with finished runs.
    """

    kind: ClassVar[str]
    beside_runs: ClassVar[bool] = False

    @property
    def needs(self) -> "tuple[Artifact, ...]":
        """What it is made from; nothing unless a subclass says more."""
        return ()

    @property
    @abstractmethod
    def file(self) -> str:
        """Its name, which differs wherever anything differs that it depends on."""

    @abstractmethod
    def make(self, cache: Cache, progress: Progress) -> None:
        """Make it where it is kept; what it needs is there.

        Raises:
            S2C2AError: it cannot be made.
        """

    @abstractmethod
    def load(self, cache: Cache) -> Made:
        """What is kept.

        Raises:
            S2C2AError: it is not there, or not whole.
        """

    @abstractmethod
    def __str__(self) -> str: ...

    def path(self, cache: Cache) -> Path:
        """Where it is kept, made or not."""
        return (cache.runs if self.beside_runs else cache.folder) / self.file

    def is_in(self, cache: Cache) -> bool:
        """Whether it is there, sound and whole."""
        with suppress(S2C2AError):
            self.load(cache)
            return True
        return False


def digest_of(*parts: object) -> str:
    """Letters that differ where a part differs, or the version of the code that makes such things."""
    return hashlib.sha256(
        repr((parts, s2c2a.__version__, REVISION)).encode()
    ).hexdigest()[:16]


@dataclass(frozen=True)
class RecordingArtifact(Artifact[Recording]):
    """A recording of the simulated arm; one that was cut short in this folder is gone on with."""

    kind = "recordings"
    arm: ArmSpec
    options: CollectOptions

    @property
    def file(self) -> str:
        """See `Artifact`."""
        digest = digest_of("recording", arm_to_toml(self.arm), self.options, DATA)
        return f"{self.arm.name}-{self.options.babbling}-seed{self.options.seed}-{digest}{ENDING}"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        told = partial(progress, f"collecting a {self}")
        collecting = partial(
            collect,
            self.path(cache),
            self.arm,
            partial(DATA.seeded, self.arm),
            self.options,
        )
        collecting = partial(
            collecting, body=str(DATA), threads=cache.threads, progress=told
        )
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
        options = self.options
        return f"recording of {self.arm.name}, {options.babbling}, {options.episodes} episodes, seed {options.seed}"


@dataclass(frozen=True)
class NetworksArtifact(Artifact[TrainedNetworks]):
    """Both networks of an arm; kept by what training depends on, so that a change of the planner trains nothing."""

    kind = "networks"
    arm: ArmSpec
    recipe: Recipe
    seed: int

    @property
    def needs(self) -> tuple[RecordingArtifact]:
        """Their recording."""
        return (RecordingArtifact(self.arm, self.recipe.collect_options(self.seed)),)

    @property
    def file(self) -> str:
        """See `Artifact`."""
        digest = digest_of(self.needs[0].file, self.recipe.training)
        return f"{self.arm.name}-{self.recipe.name}-{self.recipe.babbling}-seed{self.seed}-{digest}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""

        def told(network: str, epoch: int, most: int, loss: float) -> None:
            progress(f"training {network} of {self}", epoch, most)

        recording = self.needs[0].load(cache)
        strategies.save_strategy(
            strategies.train_s2c2a(recording, self.recipe, self.seed, told),
            self.path(cache),
        )

    def load(self, cache: Cache) -> TrainedNetworks:
        """See `Artifact`."""
        return replace(
            strategies.load_strategy(self.path(cache), self.arm), recipe=self.recipe
        )

    def __str__(self) -> str:
        return f"{self.recipe.name} networks of {self.arm.name}, seed {self.seed}"


@dataclass(frozen=True)
class LSTMArtifact(Artifact[TrainedLSTM]):
    """The trained LSTM of an arm.

    On data as fast as the paper recipe's, whatever the recipe: it follows better with
    them than with slower ones.
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

        trained = strategies.train_lstm_strategy(
            self.needs[0].load(cache), LSTMOptions(), self.seed, told
        )
        strategies.save_lstm(trained, self.path(cache))

    def load(self, cache: Cache) -> TrainedLSTM:
        """See `Artifact`."""
        return strategies.load_lstm(self.path(cache), self.arm)

    def __str__(self) -> str:
        return f"LSTM of {self.arm.name}, seed {self.seed}"


@dataclass(frozen=True)
class GivenNetworks(Artifact[TrainedNetworks]):
    """Networks of a file of the user's, kept with the runs that are made with them; read one with `read`."""

    kind = "networks"
    beside_runs = True
    arm: ArmSpec
    recipe: Recipe
    content: bytes = field(repr=False)

    @classmethod
    def read(
        cls, path: Path, arm: ArmSpec, recipe: Recipe | None = None
    ) -> "GivenNetworks":
        """Those of a strategy file, to plan as a recipe says, or as the file's own.

        Raises:
            StrategyError: no such file, damaged, for another arm, or the recipe trains
                otherwise.
        """
        networks = strategies.load_strategy(path, arm)
        return cls(
            arm,
            strategies.planning_as(networks, recipe or networks.recipe).recipe,
            path.read_bytes(),
        )

    @property
    def file(self) -> str:
        """See `Artifact`."""
        return f"weights-{hashlib.sha256(self.content).hexdigest()[:16]}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        """See `Artifact`."""
        save_whole(self.content, self.path(cache))

    def load(self, cache: Cache) -> TrainedNetworks:
        """See `Artifact`."""
        return strategies.planning_as(
            strategies.load_strategy(self.path(cache), self.arm), self.recipe
        )

    def __str__(self) -> str:
        return f"given networks of {self.arm.name}"
