"""Artifacts: recordings and networks, made once and found again in a folder.

An artifact is a key of everything that it depends on: equal keys name the same file.
"""

import hashlib
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

from s2c2a import strategies
from s2c2a.arm import ArmSpec, arm_to_toml
from s2c2a.data import CollectOptions, Recording, collect, load_recording
from s2c2a.episodes.file import ENDING
from s2c2a.errors import DamagedRecordingError, S2C2AError, StrategyError, counted
from s2c2a.execution.cache import cache_folder
from s2c2a.execution.progress import Progress
from s2c2a.execution.sources import code_digest
from s2c2a.files.text import write_atomically
from s2c2a.robots import RobotFactory
from s2c2a.runtime.border import named_errors
from s2c2a.strategies import (
    S2C2A,
    STRATEGIES,
    NetworkProgress,
    Recipe,
    StrategyOptions,
    TrainedNetworks,
)

SIMULATION = RobotFactory.simulation()
"""Data always come from the simulation `fast`."""

Made = TypeVar("Made")


@dataclass(frozen=True)
class Cache:
    """Folders of recordings, networks and finished runs; they may be deleted.

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
    """A frozen key: equal keys name the same file, on every machine.

    Attributes:
        kind: what such artifacts are called, for progress.
        beside_runs: whether it is kept with finished runs.
    """

    kind: ClassVar[str]
    beside_runs: ClassVar[bool] = False

    @property
    def needs(self) -> "tuple[Artifact, ...]":
        """What it is made from; nothing unless a subclass overrides it."""
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
    """A digest of all parts, and of the sources that they reach (`code_digest`).

    A class among them that makes the artifact lets its sources count.
    """
    written = tuple(
        arm_to_toml(part) if isinstance(part, ArmSpec) else part for part in parts
    )
    content = repr(written) + code_digest(*parts)
    return hashlib.sha256(content.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class RecordingArtifact(Artifact[Recording]):
    """A recording of the simulated arm; one that was cut short in this folder is gone on with."""

    kind = "recordings"
    arm: ArmSpec
    options: CollectOptions

    @property
    def file(self) -> str:
        digest = digest_of("recording", self.arm, self.options, SIMULATION)
        return f"{self.arm.name}-{self.options.babbling}-seed{self.options.seed}-{digest}{ENDING}"

    def make(self, cache: Cache, progress: Progress) -> None:
        collecting = partial(
            collect,
            self.path(cache),
            self.arm,
            partial(SIMULATION.seeded, self.arm),
            self.options,
            robot=str(SIMULATION),
            threads=cache.threads,
            progress=partial(progress, f"collecting a {self}"),
        )
        try:
            collecting(resume=True)
        except DamagedRecordingError:  # the cache's own file, safe to replace
            collecting(overwrite=True)

    def load(self, cache: Cache) -> Recording:
        """See `Artifact`; a whole one is never opened for writing, for others may read it too."""
        recording = load_recording(self.path(cache))
        recording.check_complete()
        return recording

    def __str__(self) -> str:
        options = self.options
        return (
            f"recording of {self.arm.name}, {options.babbling}, "
            f"{counted(options.episodes, 'episode')}, seed {options.seed}"
        )


@dataclass(frozen=True)
class Networks(Artifact[TrainedNetworks]):
    """Networks in a weight file.

    Attributes:
        arm: whose networks they are.
        recipe: how they are trained, and how to plan with them.
    """

    kind = "networks"
    arm: ArmSpec
    recipe: Recipe

    def are_of(self, strategy: str) -> bool:
        """Whether a strategy uses them: the paper's unless a subclass overrides it."""
        return strategy == S2C2A.name

    def training_progress(self, progress: Progress) -> NetworkProgress:
        """The progress of their training, which names network and artifact."""

        def report(network: str, epoch: int, epochs: int, _loss: float) -> None:
            progress(f"training {network} of {self}", epoch, epochs)

        return report

    def load(self, cache: Cache) -> TrainedNetworks:
        networks = strategies.load_networks(self.path(cache), self.arm)
        return replace(networks, recipe=self.recipe)


@dataclass(frozen=True)
class NetworksArtifact(Networks):
    """Trained networks of a strategy.

    They are found by everything that training depends on, so that another planner trains
    nothing.

    Attributes:
        arm: as its training sees it (`StrategyOptions.training_arm`).
        recipe: how they are trained.
        seed: of data and training.
        strategy: whose networks they are.
    """

    seed: int
    strategy: StrategyOptions = S2C2A()  # noqa: RUF009  # frozen

    @classmethod
    def of_recipe(cls, arm: ArmSpec, recipe: Recipe, seed: int) -> "NetworksArtifact":
        """Networks of the paper's strategy, those that runs on this arm use."""
        return cls(recipe.seen_arm(arm), recipe, seed)

    def are_of(self, strategy: str) -> bool:
        return strategy == STRATEGIES.name_of(type(self.strategy))

    @property
    def needs(self) -> tuple[RecordingArtifact, ...]:
        options = self.strategy.collect_options(self.recipe, self.seed)
        return () if options is None else (RecordingArtifact(self.arm, options),)

    @property
    def file(self) -> str:
        recordings = [recording.file for recording in self.needs]
        key = self.strategy.training_key(self.recipe)
        digest = digest_of(*recordings, type(self.strategy), key)
        parts = (
            self.arm.name,
            self.strategy.name,
            self.recipe.name,
            self.recipe.babbling,
            f"seed{self.seed}",
            digest,
        )
        return f"{'-'.join(parts)}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        recording = self.needs[0].load(cache)
        with named_errors(
            StrategyError, f"strategy '{self.strategy.name}' cannot be trained"
        ):
            networks = self.strategy.train(
                recording, self.recipe, self.seed, self.training_progress(progress)
            )
        labeled = strategies.labeled(networks, self.strategy)
        strategies.save_networks(labeled, self.path(cache))

    def __str__(self) -> str:
        name = f"{self.strategy.name} networks of {self.arm.name}"
        return f"{name}, recipe {self.recipe.name}, seed {self.seed}"


@dataclass(frozen=True)
class GivenNetworks(Networks):
    """Networks of a user's file, kept with the runs that use them; made by `read`.

    Attributes:
        arm: that is driven.
        recipe: how to plan.
        strategy: name of the strategy whose networks they are.
        content: of the file.
        session: of the present day; None for the networks as they were trained.
    """

    beside_runs = True
    strategy: str
    content: bytes = field(repr=False)
    session: strategies.Session | None = None

    @classmethod
    def read(
        cls,
        path: Path,
        arm: ArmSpec,
        recipe: Recipe | None = None,
        session: strategies.Session | None = None,
    ) -> "GivenNetworks":
        """Read a file of networks.

        Args:
            path: of the file.
            arm: that is driven.
            recipe: how to plan; the file's own if None.
            session: of the present day.

        Raises:
            StrategyError: no such file, damaged, for another arm, the recipe trains
                differently, or the session does not fit.
        """
        networks = strategies.with_session(strategies.load_networks(path, arm), session)
        if recipe is not None:
            networks = strategies.planning_as(networks, recipe)
        content = path.read_bytes()
        return cls(arm, networks.recipe, networks.strategy, content, session)

    def are_of(self, strategy: str) -> bool:
        return strategy == self.strategy

    @property
    def file(self) -> str:
        content = hashlib.sha256(self.content)
        if self.session is not None:
            content.update(self.session.model_dump_json().encode())
        return f"weights-{content.hexdigest()[:16]}.safetensors"

    def make(self, cache: Cache, progress: Progress) -> None:
        write_atomically(self.content, self.path(cache))

    def load(self, cache: Cache) -> TrainedNetworks:
        return strategies.with_session(super().load(cache), self.session)

    def __str__(self) -> str:
        return f"given networks of {self.arm.name}"
