"""The other side of `ControlProcess`: a process that moves an arm and does what it is told.

Nothing heavy is imported here, so that the process can begin before whoever starts it has imported its own part.

Both sides say that they live: this one by its snapshots, the other by its request, again and again. When that stays
away, as when the page's process hangs, nobody can press Stop any more: the arm is stopped, and goes on only when
somebody says so who knows of that: what was asked before counts as stopped.
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
from s2c2a.executors import compute_on_one_thread

if TYPE_CHECKING:
    from s2c2a.live.control import ArmControl
    from s2c2a.live.snapshot import Snapshot

TURN = 0.0005  # s after which Python lets another thread go on: the control thread gets its turn soon
MOST_WAITING = 1000  # snapshots that nobody has fetched yet
PATIENCE = 5.0  # s for what is left to say in the end
HEARTBEAT, SILENCE = 0.25, 1.5  # s between the page's signs of life, and without any until the arm is stopped
OTHERS_SIGNALS = ("SIGINT", "SIGHUP")  # of the page's process: it says stop, or is gone
KNOWN = "known"
"""What the page says when it has heard `SILENT`."""
ORDERS = ("ask", "reset", "use", "step_task", "restart_task", KNOWN)
SILENT = "the page was silent"
"""What is told when the arm was stopped for that."""


class Child:
    """A process that moves an arm, and the pipe to it; it ends with this one.

    Attributes:
        pipe: takes orders and their arguments, gives what can be asked, snapshots, answers of `use`, or an error.
        process: that it is.
    """

    def __init__(self, build: "Callable[[], ArmControl]"):
        """Start it; `build` makes the control over there, and can be pickled."""
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_control, args=(build, theirs), name="control", daemon=True)
        self.process.start()
        theirs.close()


def _control(build: "Callable[[], ArmControl]", pipe: Connection) -> None:
    """What the process does: build, run, hear orders until the other end says stop or is gone."""
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


def _run(control: "ArmControl", pipe: Connection, said: queue.Queue) -> None:
    """Run while it is wanted; in the end, whatever that is, lead the arm to rest."""
    said.put((control.limits, control.strategies))
    control.watch(lambda snapshot: _leave(said, snapshot))
    control.start()
    try:
        _go_first()
        threading.Thread(target=control.prepare, daemon=True).start()
        _obey(control, pipe, said)
    finally:
        control.stop()


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
            order, arguments = pipe.recv()
            if order not in ORDERS:
                return
            if order == KNOWN:
                silent = False
            elif order == "use":  # building a strategy takes long, so that goes beside the rest
                threading.Thread(target=_use, args=(control, arguments["name"], said), daemon=True).start()
            else:
                getattr(control, order)(**arguments | ({"stopped": True} if silent and order == "ask" else {}))


def _use(control: "ArmControl", name: str, said: queue.Queue) -> None:
    """Change the strategy; say nothing where that went well."""
    try:
        control.use(name)
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
