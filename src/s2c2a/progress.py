"""Telling how far long work has come."""

from typing import Protocol


class Progress(Protocol):
    """Told what is being done, how many parts of it are done, and how many there are."""

    def __call__(self, doing: str, done: int, total: int, /) -> None: ...


def quiet(doing: str, done: int, total: int) -> None:
    """A progress that tells nobody."""
