"""Artifacts: what is made once, kept in a folder, and found again by all that it depends on."""

import hashlib
from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

import s2c2a
from s2c2a.cache import cache_folder
from s2c2a.errors import S2C2AError
from s2c2a.progress import Progress

REVISION = 3
"""Raise it whenever simulation, babbling, training or file layout change what is kept, so that nothing old is used."""

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
    @abstractmethod
    def needs(self) -> "tuple[Artifact, ...]":
        """What it is made from."""

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
    return hashlib.sha256(repr((parts, s2c2a.__version__, REVISION)).encode()).hexdigest()[:16]
