"""Who drives: one browser at a time; the others watch and see who has the handle."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Changed = Callable[[], None]


class Session:
    """The browsers that are there, and the one that drives. From any thread."""

    def __init__(self, on_change: Changed = lambda: None):
        """Nobody is there yet; `on_change` is told when somebody takes or leaves the handle."""
        self._lock = threading.RLock()
        self._present: list[int] = []
        self._driver: int | None = None
        self._on_change = on_change

    @property
    def driver(self) -> int | None:
        """The number of the browser that drives."""
        return self._driver

    @property
    def present(self) -> tuple[int, ...]:
        """The browsers that are there, the longest first."""
        with self._lock:
            return tuple(self._present)

    def drives(self, who: int) -> bool:
        """Whether this browser drives."""
        return self._driver == who

    def join(self, who: int) -> None:
        """A browser comes; it drives where nobody else does."""
        with self._change():
            self._present.append(who)
            self._driver = who if self._driver is None else self._driver

    def leave(self, who: int) -> None:
        """A browser goes; the handle it had is free, and nobody has it until somebody takes it."""
        with self._change():
            self._present = [one for one in self._present if one != who]
            self._driver = None if self._driver == who else self._driver

    def take(self, who: int) -> bool:
        """Take the handle where it is free; returns whether this browser drives now."""
        with self._change():
            if self._driver is None and who in self._present:
                self._driver = who
        return self.drives(who)

    def give(self, who: int) -> None:
        """Leave the handle to whoever takes it."""
        with self._change():
            self._driver = None if self._driver == who else self._driver

    @contextmanager
    def _change(self) -> Iterator[None]:
        """One at a time; told when it is done."""
        with self._lock:
            yield
        self._on_change()
