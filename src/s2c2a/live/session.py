"""Who drives: one browser at a time; the others watch and see who has the handle."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Session:
    """The browsers that are there, and the one that drives. From any thread.

    Attributes:
        driver: the number of the browser that drives, if one does.
        present: the browsers that are there, the longest first.
    """

    def __init__(self, on_change: Callable[[], None] = lambda: None):
        """Nobody is there yet; `on_change` is told when somebody takes or leaves the handle."""
        self._lock, self._on_change = threading.RLock(), on_change
        self.present: tuple[int, ...] = ()
        self.driver: int | None = None

    def drives(self, who: int) -> bool:
        """Whether this browser drives."""
        return self.driver == who

    def join(self, who: int) -> None:
        """A browser comes; it drives where nobody else does."""
        with self._change():
            self.present = (*self.present, who)
            self.driver = who if self.driver is None else self.driver

    def leave(self, who: int) -> None:
        """A browser goes; the handle it had is free, and nobody has it until somebody takes it."""
        with self._change():
            self.present = tuple(one for one in self.present if one != who)
            self.driver = None if self.driver == who else self.driver

    def take(self, who: int) -> bool:
        """Take the handle where it is free; returns whether this browser drives now."""
        with self._change():
            if self.driver is None and who in self.present:
                self.driver = who
        return self.drives(who)

    def give(self, who: int) -> None:
        """Leave the handle to whoever takes it."""
        with self._change():
            self.driver = None if self.driver == who else self.driver

    @contextmanager
    def _change(self) -> Iterator[None]:
        """One at a time; told when it is done."""
        with self._lock:
            yield
        self._on_change()
