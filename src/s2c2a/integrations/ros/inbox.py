"""The latest message of each topic, handed on at a bounded rate."""

import threading


class Inbox:
    """Keeps the latest message of each topic until it is taken; for any thread."""

    def __init__(self) -> None:
        """Start empty."""
        self._lock = threading.Lock()
        self._filled = threading.Event()
        self._latest: dict[str, bytes] = {}

    def put(self, topic: str, payload: bytes) -> None:
        """Keep a message instead of the last one of its topic."""
        with self._lock:
            self._latest.pop(topic, None)  # so that the order is that of arrival
            self._latest[topic] = payload
            self._filled.set()

    def take(self, timeout: float) -> dict[str, bytes]:
        """All messages by topic, the latest last; empty after `timeout` [s] without."""
        self._filled.wait(timeout)
        with self._lock:
            self._filled.clear()
            latest = self._latest
            self._latest = {}
        return latest
