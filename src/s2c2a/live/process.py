"""What moves the arm, in a process of its own: neither drawing nor browsers take its turn.

Two threads of one Python process wait for each other; two processes do not. Requests
and orders go there through a pipe, snapshots come back.

Both sides say that they live: that one by its snapshots, this one by its request, again
and again. When that stays away, as when the page's process hangs, nobody can press Stop
any more: the arm is stopped, and goes on only when somebody says so who knows of that:
what was asked before counts as stopped.

Nothing heavy is imported here, so that the process can begin before whoever starts it
has imported its own part.
"""

import multiprocessing
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.executors import compute_on_one_thread
from s2c2a.live.request import Request, RequestLimits
from s2c2a.live.snapshot import PATIENCE, Control, Snapshot
from s2c2a.spaces import Stage

if TYPE_CHECKING:
    from s2c2a.live.control import ArmControl

ENDED = "the control process has ended; start again"
MISSED = "the control process does not answer"
MAX_MISSED = 1.5  # s, and two control periods, without a snapshot
# s after which Python lets another thread go on: the control thread gets its turn soon
TURN = 0.0005
MAX_WAITING = 1000  # snapshots that nobody has fetched yet
# s between the page's signs of life, and without any until the arm is stopped
HEARTBEAT = 0.25
SILENCE = 1.5
OTHERS_SIGNALS = ("SIGINT", "SIGHUP")  # of the page's process: it says stop, or is gone
SILENT = "the page was silent"
"""What is told when the arm was stopped for that; the page says that it is `known`."""


class ControlProcess(Control):
    """The arm's control in another process; it ends with this one.

    Attributes:
        process: the number of the process.
    """

    def __init__(self, arm: ArmSpec, build: "Callable[[], ArmControl]"):
        """Start the process; it may take seconds until `wait_until_ready` returns.

        Args:
            arm: what its control will drive.
            build: makes the control over there, and can be pickled.
        """
        super().__init__()
        self.arm = arm
        self.limits = RequestLimits.of(arm, ())
        self._fault = ""
        self._heard = time.perf_counter()
        self._ready = threading.Event()
        self._stopping = threading.Event()
        self._using = threading.Lock()
        self._used = queue.SimpleQueue[str]()
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=_control, args=(build, theirs), name="control", daemon=True
        )
        self._process.start()
        self.process = self._process.pid
        theirs.close()
        self._listener = threading.Thread(
            target=self._listen, name="snapshots", daemon=True
        )
        self._listener.start()
        threading.Thread(target=self._live, name="heartbeat", daemon=True).start()

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, None before the first; it says so where none has come for too long."""
        latest = self._latest
        missing = self._missing()
        if latest is None or not missing or self._stopping.is_set():
            return latest
        return replace(latest, stage=Stage.FAULT, fault=missing)

    @property
    def answers(self) -> bool:
        """See `Control`."""
        return not self._missing()

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
            asked = super().ask(**changes)
            self.order("ask", vars(asked))
        return asked

    def order(self, name: str, *arguments: Any) -> None:
        """See `Control`; nothing is said to one that does not answer, but to stop: the pipe would fill up."""
        if self._missing() and name != "stop":
            return
        with self._lock, suppress(OSError):  # nobody there any more: `_listen` says so
            self._pipe.send((name, arguments))

    def reset(self) -> None:
        """See `Control`."""
        self._check_alive()
        super().reset()

    def use(self, name: str) -> None:
        """See `Control`; it is built over there, which can take seconds, and this returns when it is done."""
        with self._using:
            self._check_alive()
            self.order("use", name)
            said = self._used.get()
            if said:
                raise S2C2AError(said)

    def stop(self) -> None:
        """See `Control`; a process that does not hear is ended."""
        self._stopping.set()
        self.order("stop")
        if self._latest is not None:  # else it may still be compiling
            self.wait_for_rest(self._process)
        # nothing happens to one that has ended
        for end in (self._process.terminate, self._process.kill):
            end()
            self._process.join(PATIENCE)
        self._listener.join(PATIENCE)
        self._pipe.close()

    def _missing(self) -> str:
        """Why nobody answers, or nothing."""
        quiet = time.perf_counter() - self._heard
        if not self._process.is_alive():
            return ENDED
        return (
            MISSED
            if self._latest is not None
            and quiet > MAX_MISSED + 2 * self.arm.control_period
            else ""
        )

    def _check_alive(self) -> None:
        if missing := self._missing():
            raise S2C2AError(missing)

    def _live(self) -> None:
        """Say again what is asked, until this side stops: a sign of life, and news for one that did not answer."""
        while not self._stopping.wait(HEARTBEAT):
            if self._latest is not None:  # before that nobody empties the pipe
                self.ask()

    def _listen(self) -> None:
        """Fetch what comes until the process ends."""
        try:
            while (said := self._fetched()) is not None:
                self._take(said)
        finally:
            self._fault = self._fault or ENDED
            self._process.join(PATIENCE)  # whoever asks next finds it ended
            self._used.put(ENDED)
            self._ready.set()

    def _fetched(self) -> Any:
        """What comes next; None when nothing will."""
        # the last where the pipe is closed meanwhile
        with suppress(EOFError, OSError, TypeError):
            return self._pipe.recv()
        return None

    def _take(self, said: Any) -> None:
        """A snapshot; before the first one what can be asked, or why there will be none; or how `use` ended."""
        self._heard = time.perf_counter()
        match said:
            case Snapshot():
                self._show(said)
                self._ready.set()
            case S2C2AError():
                self._fault = str(said)  # and the end comes at once
            case tuple():
                self.limits, self.strategies = said
            # it was stopped over there: here, too, until somebody says go on
            case _ if said == SILENT:
                with self._lock:
                    self.halt(SILENT)
                    self.order("known")
            case _:
                self._used.put(said)


def _control(build: "Callable[[], ArmControl]", pipe: Connection) -> None:
    """What the process does: build, run, hear orders until the other end says stop or is gone."""
    for name in vars(signal).keys() & OTHERS_SIGNALS:  # not every system has all
        signal.signal(vars(signal)[name], signal.SIG_IGN)
    sys.setswitchinterval(TURN)
    compute_on_one_thread()
    said: queue.Queue[Any] = queue.Queue(MAX_WAITING)
    passing = threading.Thread(
        target=_pass_on, args=(said, pipe), name="snapshots", daemon=True
    )
    passing.start()
    try:
        control = build()
        said.put((control.limits, control.strategies))
        control.watch(partial(_leave, said))
        # before there is nothing to lead to rest
        signal.signal(signal.SIGTERM, lambda *_: sys.exit())
        try:
            control.start()
            _go_first()
            threading.Thread(target=control.prepare, daemon=True).start()
            _obey(control, pipe, said)
        finally:  # whatever that is, the arm goes to rest
            control.stop()
    except S2C2AError as error:
        said.put(error)
    said.put(None)
    passing.join(PATIENCE)


def _go_first() -> None:
    """Let the threads that are there now run before all others, where the system lets anybody (Linux: root, mostly).

    Python threads that are started later, to build a strategy, get no more than their
    share.
    """
    if not hasattr(os, "SCHED_RESET_ON_FORK"):
        return
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    least = os.sched_param(os.sched_get_priority_min(os.SCHED_FIFO))
    for thread in os.listdir("/proc/self/task"):
        with suppress(OSError):  # not allowed, or just ended
            os.sched_setscheduler(int(thread), policy, least)


def _obey(control: "ArmControl", pipe: Connection, said: queue.Queue) -> None:
    """Do what is ordered, in order; stop the arm where nothing is heard for too long, not even a sign of life."""
    silent = False  # and the page does not know yet that the arm was stopped for that
    with suppress(EOFError, OSError):
        while True:
            if not pipe.poll(SILENCE):
                if control.request.driven and not control.request.stopped:
                    control.halt(SILENT)
                    silent = True
                    said.put(SILENT)
                continue
            match pipe.recv():
                case "ask", (asked,):
                    control.ask(**asked | ({"stopped": True} if silent else {}))
                case "known", ():
                    silent = False
                # building a strategy takes long, so that goes beside the rest
                case "use", (name,):
                    threading.Thread(
                        target=_use, args=(control, name, said), daemon=True
                    ).start()
                case "begin" | "move_on" as name, arguments:
                    control.order(name, *arguments)
                case _:
                    return


def _use(control: "ArmControl", name: str, said: queue.Queue) -> None:
    """Change the strategy; say nothing where that went well."""
    try:
        control.use(name)
        said.put("")
    except Exception as error:  # whatever it is, somebody waits for the answer
        said.put(str(error) or type(error).__name__)


def _leave(said: queue.Queue, snapshot: Snapshot) -> None:
    """Leave a snapshot to be fetched; never wait for whoever fetches."""
    with suppress(queue.Full):
        said.put_nowait(snapshot)


def _pass_on(said: queue.Queue, pipe: Connection) -> None:
    """Hand on what is said, until None; what cannot be handed on is dropped."""
    for something in iter(said.get, None):
        with suppress(OSError):
            pipe.send(something)
