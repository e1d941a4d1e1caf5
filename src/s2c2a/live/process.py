"""What moves the arm, in a process of its own: neither drawing nor browsers take its turn.

Two threads of one Python process wait for each other; two processes do not. Requests and orders go there through a
pipe, snapshots come back; each side tells the other that it lives (`child`).
"""

import queue
import threading
import time
from contextlib import suppress
from dataclasses import replace
from typing import Any, cast

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.live.child import HEARTBEAT, KNOWN, PATIENCE, SILENT, Child
from s2c2a.live.request import Request, RequestLimits
from s2c2a.live.snapshot import Control, Snapshot
from s2c2a.spaces import Stage

ENDED = "the control process has ended; start again"
MISSED = "the control process does not answer"
MOST_MISSED = 1.5  # s, and two control periods, without a snapshot


class ControlProcess(Control):
    """The arm's control in another process; it ends with this one."""

    def __init__(self, arm: ArmSpec, child: Child):
        """Speak to a process; it may take seconds until `wait_until_ready` returns.

        Args:
            arm: what its control will drive.
            child: already started.
        """
        super().__init__()
        self.arm, self.limits = arm, RequestLimits.of(arm, ())
        self.strategies: tuple[str, ...] = ()
        self._fault, self._heard = "", time.perf_counter()
        self._ready, self._stopping = threading.Event(), threading.Event()
        self._using, self._used = threading.Lock(), cast("queue.SimpleQueue[str]", queue.SimpleQueue())
        self._pipe, self._process = child.pipe, child.process
        self._listener = threading.Thread(target=self._listen, name="snapshots", daemon=True)
        self._listener.start()
        threading.Thread(target=self._live, name="heartbeat", daemon=True).start()

    @property
    def process(self) -> int | None:
        """The number of the process."""
        return self._process.pid

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, None before the first; it says so where none has come for too long."""
        latest = self._latest
        if latest is None or latest.stage is Stage.FAULT or not self._silent():
            return latest
        return replace(latest, stage=Stage.FAULT, fault=MISSED)

    @property
    def answers(self) -> bool:
        """See `Control`."""
        return self._process.is_alive() and not self._silent()

    def wait_until_ready(self, timeout: float = 600.0) -> None:
        """Return when the arm is open and moved.

        Raises:
            S2C2AError: it could not be built or opened, or not in time.
        """
        if not self._ready.wait(timeout):
            raise S2C2AError(f"the arm did not open within {timeout:g} s")
        if self._fault:
            raise S2C2AError(self._fault)

    def ask(self, **changes: Any) -> Request:
        """See `Control`."""
        with self._lock:
            super().ask(**changes)
            self._send("ask", **vars(self._request))
            return self._request

    def reset(self) -> None:
        """See `Control`.

        Raises:
            S2C2AError: there is nobody any more who could.
        """
        with self._lock:
            self._check_alive()
            self.ask(target=None, axis=None, task=None, playing=False)
            self._send("reset")

    def use(self, name: str) -> None:
        """See `Control`; it is built over there, which can take seconds, and this returns when it is done."""
        with self._using:
            self._check_alive()
            self._send("use", name=name)
            said = self._used.get()
            if said == ENDED:
                self._used.put(ENDED)  # for whoever asks next
            if said:
                raise S2C2AError(said)

    def step_task(self) -> None:
        """See `Control`."""
        self._send("step_task")

    def restart_task(self) -> None:
        """See `Control`."""
        self._send("restart_task")

    def stop(self) -> None:
        """See `Control`; a process that does not hear is ended."""
        self._stopping.set()
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

    def _check_alive(self) -> None:
        if not self._process.is_alive():
            raise S2C2AError(ENDED)
        if self._silent():
            raise S2C2AError(MISSED)

    def _live(self) -> None:
        """Say again what is asked, until this side stops: a sign of life, and news for one that did not answer."""
        while not self._stopping.wait(HEARTBEAT):
            if self._latest is not None:  # before that nobody empties the pipe
                self.ask()

    def _silent(self) -> bool:
        quiet = time.perf_counter() - self._heard
        return self._latest is not None and quiet > MOST_MISSED + 2 * self.arm.control_period

    def _send(self, order: str, **arguments: Any) -> None:
        if self._silent() and order != "stop":
            return  # nobody takes it out of the pipe, which would fill up
        with self._lock, suppress(OSError):  # nobody there any more: `_listen` says so
            self._pipe.send((order, arguments))

    def _listen(self) -> None:
        """Fetch what comes until the process ends."""
        try:
            while (said := self._fetched()) is not None:
                self._heard = time.perf_counter()
                self._take(said)
        finally:
            self._fault = self._fault or ENDED
            self._used.put(ENDED)
            self._ready.set()
            if self._latest is not None and not self._stopping.is_set():
                self._show(replace(self._latest, stage=Stage.FAULT, fault=ENDED))

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
        elif said == SILENT:  # it was stopped over there: here, too, until somebody says go on
            with self._lock:
                self.halt(SILENT)
                self._send(KNOWN)
        elif isinstance(said, str):
            self._used.put(said)
        else:
            self.limits, self.strategies = said
