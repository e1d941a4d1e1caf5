"""The other side of `ControlProcess`: a process that makes a control loop and does what it is told.

Nothing heavy is imported here, so that the process can begin before whoever starts it has imported its own part.
"""

import multiprocessing
import os
import queue
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from s2c2a.errors import S2C2AError
from s2c2a.shards import compute_on_one_thread

if TYPE_CHECKING:
    from s2c2a.live.loop import ControlLoop
    from s2c2a.live.snapshot import Snapshot

TURN = 0.0005  # s after which Python lets another thread go on: the control thread gets its turn soon
MOST_WAITING = 1000  # snapshots that nobody has fetched yet
PATIENCE = 5.0  # s for what is left to say in the end
OTHERS_SIGNALS = ("SIGINT", "SIGHUP")  # of the page's process: it says stop, or is gone
REQUESTS = ("ask", "reset", "use", "step_task", "restart_task")


class Child:
    """A process that makes a control loop, and the pipe to it; it ends with this one.

    Attributes:
        pipe: takes requests and their arguments, gives what can be asked, snapshots, answers of `use`, or an error.
        process: that it is.
    """

    def __init__(self, build: "Callable[[], ControlLoop]"):
        """Start it; `build` makes the loop over there, and can be pickled."""
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_control, args=(build, theirs), name="control", daemon=True)
        self.process.start()
        theirs.close()


def _control(build: "Callable[[], ControlLoop]", pipe: Connection) -> None:
    """What the process does: build the loop, run it, hear requests until the other end says stop or is gone."""
    for name in OTHERS_SIGNALS:
        if hasattr(signal, name):  # not every system has all
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    sys.setswitchinterval(TURN)
    compute_on_one_thread()
    said: queue.Queue[Any] = queue.Queue(MOST_WAITING)
    passing = threading.Thread(target=_pass_on, args=(said, pipe), name="snapshots", daemon=True)
    passing.start()
    try:
        _run(build(), pipe, said)
    except S2C2AError as error:
        said.put(error)
    said.put(None)
    passing.join(PATIENCE)


def _run(loop: "ControlLoop", pipe: Connection, said: queue.Queue) -> None:
    """Run the loop while it is wanted; in the end, whatever that is, lead the arm to rest."""
    said.put((loop.limits, loop.strategies))
    loop.watch(lambda snapshot: _leave(said, snapshot))
    loop.start()
    try:
        _go_first()
        threading.Thread(target=loop.prepare, daemon=True).start()
        _obey(loop, pipe, said)
    finally:
        loop.stop()


def _go_first() -> None:
    """Let the threads that are there now run before all others, where the system lets anybody (Linux: root, mostly).

    Python threads that are started later, to build a strategy, get no more than their share.
    """
    if not hasattr(os, "SCHED_RESET_ON_FORK"):
        return
    policy, least = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(os.sched_get_priority_min(os.SCHED_FIFO))
    for thread in os.listdir("/proc/self/task"):
        with suppress(OSError):  # not allowed, or just ended
            os.sched_setscheduler(int(thread), policy, least)


def _obey(loop: "ControlLoop", pipe: Connection, said: queue.Queue) -> None:
    """Do what is asked, in order; building a strategy takes long, so that goes beside the rest."""
    with suppress(EOFError, OSError):
        while True:
            request, arguments = pipe.recv()
            if request not in REQUESTS:
                return
            if request == "use":
                threading.Thread(target=_use, args=(loop, arguments["name"], said), daemon=True).start()
            else:
                getattr(loop, request)(**arguments)


def _use(loop: "ControlLoop", name: str, said: queue.Queue) -> None:
    """Change the strategy; say nothing where that went well."""
    try:
        loop.use(name)
        said.put("")
    except Exception as error:  # whatever it is, somebody waits for the answer
        said.put(str(error) or type(error).__name__)


def _leave(said: queue.Queue, snapshot: "Snapshot") -> None:
    """Leave a snapshot to be fetched; never wait for whoever fetches."""
    with suppress(queue.Full):
        said.put_nowait(snapshot)


def _pass_on(said: queue.Queue, pipe: Connection) -> None:
    """Hand on what is said, until None; what cannot be handed on is dropped."""
    while True:
        something = said.get()
        with suppress(OSError):
            if something is not None:
                pipe.send(something)
        if something is None:
            return
