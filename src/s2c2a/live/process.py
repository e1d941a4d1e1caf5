"""Control of the arm in a separate process, which browsers and drawing cannot delay.

Two threads of one Python process wait for each other; two processes do not. Requests
and commands go to the control process through a pipe, snapshots come back.

Both processes send heartbeats: the control process its snapshots, the page's process
its request. Without the page's heartbeat, for example because its process hangs, no user
can press Stop: the control process stops the arm and ignores earlier requests to move
until the page has received the notice of the stop and the driver resumes.

This module imports nothing heavy, so that the control process starts early.
"""

import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from s2c2a.arm import ArmSpec
from s2c2a.errors import S2C2AError
from s2c2a.execution.child import spawning
from s2c2a.execution.executors import limit_jax_to_one_thread
from s2c2a.live.request import Request, RequestLimits
from s2c2a.live.snapshot import PATIENCE, Control, Snapshot
from s2c2a.plugins.discovery import run_with_trust, trusted_code
from s2c2a.spaces import Stage

if TYPE_CHECKING:
    from s2c2a.live.control import ArmControl

ENDED = "the control process has ended; start s2c2a live again"
NOT_RESPONDING = "the control process does not respond"
MAX_SNAPSHOT_AGE = 1.5  # s; plus two control periods
SWITCH_INTERVAL = 0.0005  # s; short, so that the control thread soon gets the GIL
MAX_QUEUED = 1000  # snapshots that wait for the pipe
HEARTBEAT = 0.25  # s between heartbeats of the page's process
HEARTBEAT_TIMEOUT = 1.5  # s without a heartbeat until the arm is stopped
IGNORED_SIGNALS = ("SIGINT", "SIGHUP")  # the page's process handles them
PAGE_LOST = "no signal from the page"
"""Message and reason of a stop without heartbeats; the page confirms it by `known`."""


@dataclass(frozen=True)
class Halted:
    """Message to the page: the control process stopped the arm.

    Attributes:
        reason: for the driver, who must resume.
    """

    reason: str


class ControlProcess(Control):
    """Control of an arm in another process, which ends with this one.

    Attributes:
        process: id of the control process.
    """

    def __init__(self, arm: ArmSpec, build: "Callable[[], ArmControl]"):
        """Start the process; `wait_until_ready` returns when the arm is open.

        Args:
            arm: to be controlled.
            build: creates the control in the other process; must be picklable.
        """
        super().__init__()
        self.arm = arm
        self.limits = RequestLimits.of(arm, ())
        self._fault = ""
        self._last_message = time.perf_counter()
        self._ready = threading.Event()
        self._stopping = threading.Event()
        self._using = threading.Lock()
        self._use_results = queue.SimpleQueue[str]()
        context = spawning()
        self._pipe, other_end = context.Pipe()
        trusting_build = partial(run_with_trust, trusted_code(), build)
        self._process = context.Process(
            target=_run_control,
            args=(trusting_build, other_end),
            name="control",
            daemon=True,
        )
        self._process.start()
        self.process = self._process.pid
        other_end.close()
        self._receiver = threading.Thread(
            target=self._receive_all, name="snapshots", daemon=True
        )
        self._receiver.start()
        threading.Thread(
            target=self._send_heartbeats, name="heartbeat", daemon=True
        ).start()

    @property
    def latest(self) -> Snapshot | None:
        """The latest snapshot, or None before the first; a fault if it is too old."""
        latest = self._latest
        problem = self._problem()
        if latest is None or not problem or self._stopping.is_set():
            return latest
        return replace(latest, stage=Stage.FAULT, fault=problem)

    @property
    def responds(self) -> bool:
        return not self._problem()

    def wait_until_ready(self) -> None:
        """Wait until the arm is open and controlled, however long the process compiles.

        Raises:
            S2C2AError: the control could not be built, the arm did not open, or the
                process has ended.
        """
        # on Windows, Ctrl-C cannot interrupt a longer wait
        while not self._ready.wait(HEARTBEAT):
            pass
        if self._fault:
            raise S2C2AError(self._fault)

    def ask(self, **changes: Any) -> Request:
        with self._lock:
            request = super().ask(**changes)
            self.order("ask", vars(request))
        return request

    def order(self, name: str, *arguments: Any) -> None:
        """See `Control`; a process that does not respond gets only `stop`.

        Other commands would fill the pipe.
        """
        if self._problem() and name != "stop":
            return
        # OSError: the process has ended, which `_receive_all` reports
        with self._lock, suppress(OSError):
            self._pipe.send((name, arguments))

    def reset(self) -> None:
        self._check_response()
        super().reset()

    def use(self, name: str) -> None:
        """See `Control`; waits until the other process has built the strategy."""
        with self._using:
            self._check_response()
            self.order("use", name)
            error = self._use_results.get()
            if error:
                raise S2C2AError(error)

    def stop_at_once(self) -> None:
        """Trigger the emergency stop of the control process."""
        if self.process is not None and self._process.is_alive():
            os.kill(self.process, signal.SIGUSR1)

    def stop(self) -> None:
        """See `Control`; kills a process that does not respond."""
        self._stopping.set()
        self.order("stop")
        if self._latest is not None:  # otherwise it may still be compiling
            self.wait_for_rest(self._process)
        # no effect on a process that has ended
        for end in (self._process.terminate, self._process.kill):
            end()
            self._process.join(PATIENCE)
        self._receiver.join(PATIENCE)
        self._pipe.close()

    def _problem(self) -> str:
        """Why the process does not respond, or nothing."""
        if not self._process.is_alive():
            return ENDED
        age = time.perf_counter() - self._last_message
        max_age = MAX_SNAPSHOT_AGE + 2 * self.arm.control_period
        return NOT_RESPONDING if self._latest is not None and age > max_age else ""

    def _check_response(self) -> None:
        if problem := self._problem():
            raise S2C2AError(problem)

    def _send_heartbeats(self) -> None:
        """Repeat the request until `stop`, also for a process that missed changes."""
        while not self._stopping.wait(HEARTBEAT):
            if self._latest is not None:  # before, the process does not read the pipe
                self.ask()

    def _receive_all(self) -> None:
        """Receive messages until the process ends."""
        try:
            while (message := self._receive()) is not None:
                self._handle(message)
        finally:
            self._fault = self._fault or ENDED
            self._process.join(PATIENCE)  # so that later calls find it ended
            self._use_results.put(ENDED)
            self._ready.set()

    def _receive(self) -> Any:
        """The next message, or None after the last."""
        # TypeError: the pipe was closed during the call
        with suppress(EOFError, OSError, TypeError):
            return self._pipe.recv()
        return None

    def _handle(self, message: Any) -> None:
        """Handle a message of the control process.

        It sends limits and strategies first or an error, then snapshots, the result of
        each `use`, and `Halted` after a stop of its own.
        """
        self._last_message = time.perf_counter()
        match message:
            case Snapshot():
                self._show(message)
                self._ready.set()
            case S2C2AError():
                self._fault = str(message)  # the process ends next
            case tuple():
                self.limits, self.strategies = message
            case Halted(reason=reason):
                with self._lock:
                    self.halt(reason)
                    self.order("known")
            case _:
                self._use_results.put(message)


def _run_control(build: "Callable[[], ArmControl]", pipe: Connection) -> None:
    """Main function of the control process: builds and runs the control."""
    for name in vars(signal).keys() & IGNORED_SIGNALS:  # not every system has all
        signal.signal(vars(signal)[name], signal.SIG_IGN)
    sys.setswitchinterval(SWITCH_INTERVAL)
    limit_jax_to_one_thread()
    messages: queue.Queue[Any] = queue.Queue(MAX_QUEUED)
    sender = threading.Thread(
        target=_send_all, args=(messages, pipe), name="snapshots", daemon=True
    )
    sender.start()
    try:
        control = build()
        messages.put((control.limits, control.strategies))
        control.watch(partial(_queue_snapshot, messages))
        from s2c2a.runtime.emergency import stop_on_signal  # noqa: PLC0415  # now loaded

        # from here on, an exit returns the arm to rest
        signal.signal(signal.SIGTERM, lambda *_: sys.exit())
        with stop_on_signal():  # also while the arm opens and returns to rest
            try:
                control.start()
                _raise_priority()
                threading.Thread(target=control.prepare, daemon=True).start()
                _obey(control, pipe, messages)
            finally:
                control.stop()
    except S2C2AError as error:
        messages.put(error)
    messages.put(None)
    sender.join(PATIENCE)


def _raise_priority() -> None:
    """Give real-time priority to the current threads, if permitted (Linux, root).

    Threads that start later, for example to build a strategy, get normal priority.
    """
    if not hasattr(os, "SCHED_RESET_ON_FORK"):
        return
    policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    lowest = os.sched_param(os.sched_get_priority_min(os.SCHED_FIFO))
    for thread in os.listdir("/proc/self/task"):
        with suppress(OSError):  # not permitted, or the thread has ended
            os.sched_setscheduler(int(thread), policy, lowest)


def _obey(control: "ArmControl", pipe: Connection, messages: queue.Queue) -> None:
    """Execute commands until `stop` or the end of the page's process.

    Stops the arm when heartbeats are missing.
    """
    lost = False  # stopped by this process, and the page has not confirmed it
    standstill = ""
    with suppress(EOFError, OSError):
        while True:
            if not pipe.poll(HEARTBEAT_TIMEOUT):
                if control.request.driven and not control.request.stopped:
                    control.halt(PAGE_LOST)
                    lost = True
                    messages.put(Halted(PAGE_LOST))
                continue
            # requests of before it must not move the arm again
            if control.standstill != standstill:
                standstill = control.standstill
                lost = lost or bool(standstill)
                if standstill:
                    messages.put(Halted(standstill))
            match pipe.recv():
                case "ask", (request,):
                    if lost:
                        request["stopped"] = True
                    control.ask(**request)
                case "known", ():
                    lost = False
                case "use", (name,):
                    # building a strategy takes seconds
                    threading.Thread(
                        target=_use, args=(control, name, messages), daemon=True
                    ).start()
                case "reopen" | "advance" as name, arguments:
                    control.order(name, *arguments)
                case _:
                    return


def _use(control: "ArmControl", name: str, messages: queue.Queue) -> None:
    """Change the strategy; sends the error, or an empty text."""
    try:
        control.use(name)
        messages.put("")
    except Exception as error:  # any error, since the page waits for the result
        messages.put(str(error) or type(error).__name__)


def _queue_snapshot(messages: queue.Queue, snapshot: Snapshot) -> None:
    """Queue a snapshot without waiting; drop it if the queue is full."""
    with suppress(queue.Full):
        messages.put_nowait(snapshot)


def _send_all(messages: queue.Queue, pipe: Connection) -> None:
    """Send queued messages until None; drops messages that cannot be sent."""
    for message in iter(messages.get, None):
        with suppress(OSError):
            pipe.send(message)
