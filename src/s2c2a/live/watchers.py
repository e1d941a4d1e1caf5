"""Whoever wants to be told of every snapshot."""

import threading
from collections.abc import Callable

from s2c2a.live.snapshot import Snapshot

Watcher = Callable[[Snapshot], None]


class Watchers:
    """Those who watch; they come and go from any thread."""

    def __init__(self) -> None:
        """Nobody yet."""
        self._lock = threading.Lock()
        self._all: tuple[Watcher, ...] = ()

    def add(self, watcher: Watcher) -> Callable[[], None]:
        """Tell a watcher from now on; returns what ends it."""
        with self._lock:
            self._all = (*self._all, watcher)

        def end() -> None:
            with self._lock:
                self._all = tuple(one for one in self._all if one is not watcher)

        return end

    def tell(self, snapshot: Snapshot) -> None:
        """Tell all of them."""
        for watcher in self._all:
            watcher(snapshot)
