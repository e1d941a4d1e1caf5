"""Progress callbacks of long work."""

from typing import Protocol


class Progress(Protocol):
    """Callback with the name of the work, the steps done and their total number."""

    def __call__(self, work: str, done: int, total: int, /) -> None:
        """Report the state of the work."""


def quiet(work: str, done: int, total: int) -> None:
    """Progress callback that does nothing."""
