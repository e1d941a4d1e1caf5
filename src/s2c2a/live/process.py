"""The control loop in a process of its own: neither drawing nor browsers take its turn.

Two threads of one Python process wait for each other; two processes do not. Wishes and requests go there through a
pipe, snapshots come back.
"""

import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.live.child import PATIENCE, Child
from s2c2a.live.snapshot import Control, Snapshot, Stage
from s2c2a.live.watchers import Watchers
from s2c2a.live.wish import Limits, Wish

ENDED = "the control process has ended; start again"


class ControlProcess(Control):
    """A control loop in another process; it ends with this one."""

    def __init__(self, arm: ArmSpec, child: Child):
        """Speak to a process; it may take seconds until `wait_until_ready` returns.

        Args:
            arm: what its loop will drive.
            child: already started.
        """
        self.arm, self.limits = arm, Limits.of(arm, ())
        self.strategies: tuple[str, ...] = ()
        self._wish, self._latest, self._fault = Wish(), cast("Snapshot | None", None), ""
        self._watchers = Watchers()
        self._lock, self._ready = threading.RLock(), threading.Event()
        self._using, self._used = threading.Lock(), cast("queue.SimpleQueue[str]", queue.SimpleQueue())
        self._pipe, self._process, self._stopping = child.pipe, child.process, False
        self._listener = threading.Thread(target=self._listen, name="snapshots", daemon=True)
        self._listener.start()

    @property
    def process(self) -> int | None:
        """The number of the process."""
        return self._process.pid

    @property
    def wish(self) -> Wish:
        """The latest wish."""
        return self._wish

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, None before the first."""
        return self._latest

    def wait_until_ready(self, timeout: float = 600.0) -> None:
        """Return when the arm is open and the loop runs.

        Raises:
            S2C2AError: it could not be built or opened, or not in time.
        """
        if not self._ready.wait(timeout):
            raise S2C2AError(f"the arm did not open within {timeout:g} s")
        if self._fault:
            raise S2C2AError(self._fault)

    def ask(self, **changes: Any) -> Wish:
        """Change the wish, within the limits; returns what it has become. From any thread."""
        with self._lock:
            self._wish = self.limits.changed(self._wish, **changes)
            self._send("ask", **vars(self._wish))
            return self._wish

    def reset(self) -> None:
        """Open the robot anew, at rest; wishes that would move it at once are forgotten."""
        with self._lock:
            self.ask(target=None, axis=None, task=None, playing=False)
            self._send("reset")

    def use(self, name: str) -> None:
        """Drive with another strategy from now on; the arm goes to rest first, where strategies begin.

        It is built over there, which can take seconds; this returns when it is done.

        Raises:
            S2C2AError: no such strategy, or it cannot be built.
        """
        with self._using:
            self._send("use", name=name)
            said = self._used.get()
            if said == ENDED:
                self._used.put(ENDED)  # for whoever asks next
            if said:
                raise S2C2AError(said)

    def step_task(self) -> None:
        """One step of a task that waits."""
        self._send("step_task")

    def restart_task(self) -> None:
        """Back to the task's first step."""
        self._send("restart_task")

    def watch(self, watcher: Callable[[Snapshot], None]) -> Callable[[], None]:
        """Call a watcher with every snapshot, in the thread that fetches them. Returns what ends it."""
        return self._watchers.add(watcher)

    def stop(self) -> None:
        """Lead the arm to rest, close it, and end the process; one that does not hear is ended."""
        self._stopping = True
        self._send("stop")
        ends = (self._process.terminate, self._process.kill)
        if self._latest is None:  # nothing to lead to rest, and it may still be compiling
            ends[0]()
        for end in ends:
            self._process.join(PATIENCE)
            if self._process.is_alive():
                end()
        self._process.join(PATIENCE)
        self._listener.join(PATIENCE)
        self._pipe.close()

    def _send(self, request: str, **arguments: Any) -> None:
        with self._lock, suppress(OSError):  # nobody there any more: `_listen` says so
            self._pipe.send((request, arguments))

    def _listen(self) -> None:
        """Fetch what comes until the process ends."""
        try:
            while (said := self._fetched()) is not None:
                self._take(said)
        finally:
            self._fault = self._fault or ENDED
            self._used.put(ENDED)
            self._ready.set()
            if self._latest is not None and not self._stopping:
                self._show(replace(self._latest, stage=Stage.FAILED, fault=ENDED, moment=time.perf_counter()))

    def _fetched(self) -> Any:
        """What comes next; None when nothing will."""
        with suppress(EOFError, OSError, TypeError):  # the last where the pipe is closed meanwhile
            return self._pipe.recv()
        return None

    def _take(self, said: Any) -> None:
        """A snapshot; before the first one what can be asked, or why there will be none; or how `use` ended."""
        if isinstance(said, Snapshot):
            self._show(said)
            self._ready.set()
        elif isinstance(said, S2C2AError):
            self._fault = str(said)
            self._ready.set()
        elif isinstance(said, str):
            self._used.put(said)
        else:
            self.limits, self.strategies = said

    def _show(self, snapshot: Snapshot) -> None:
        self._latest = snapshot
        self._watchers.tell(snapshot)
