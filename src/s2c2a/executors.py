"""Who does work side by side: executors of the standard kind, for this process, threads, all cores; dask's fit too.

What is handed to them is a function and what it is given. It depends on nothing else
(its seed is part of what it is given), so its result is the same wherever and in
whatever order it is worked out, and what is lost is done again.
"""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

from s2c2a.errors import S2C2AError

Given = TypeVar("Given")
Result = TypeVar("Result")

BEGUN_EACH = 2
"""Calls begun or waiting for each worker: nobody idles, and few results wait in
memory."""
WORKERS_UNSAID = 32
"""Workers that an executor is taken to have if it does not say how many, by an
attribute `workers`."""
MEMORY_EACH = 1.5e9
"""What a process takes that trains networks or drives a strategy [bytes], with some
room (docs/cluster.md)."""


def all_cores() -> int:
    """How many cores this process may use."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )


def processes_that_fit() -> int:
    """One for every core, and no more than memory holds."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(1, min(all_cores(), int(memory / MEMORY_EACH)))


def compute_on_one_thread() -> None:
    """Let JAX's CPU take one thread in this process; it heeds this until its first computation.

    How XLA cuts up a sum depends on how many threads it has, and so does the last bit
    of a trained weight. With one, a seed gives the same networks on any number of
    cores. These networks are so small that more threads gain nothing.
    """
    # the second is what older versions of XLA read
    os.environ.update(PJRT_NPROC="1", NPROC="1")


class Serial(Executor):
    """This process: a call is over when it has been submitted. An interrupt comes out at once."""

    def submit(self, fn: Callable[..., Result], /, *given, **named) -> Future[Result]:
        """Do it now."""
        done: Future[Result] = Future()
        try:
            done.set_result(fn(*given, **named))
        except Exception as error:
            done.set_exception(error)
        return done


class Threads(ThreadPoolExecutor):
    """Threads of this process, for work that is not Python's: the physics of MuJoCo; one a core unless stated."""

    def __init__(self, workers: int | None = None):
        self.workers = checked_count(workers, all_cores)
        super().__init__(self.workers)


class Processes(ProcessPoolExecutor):
    """Processes of this machine, one thread each: cores are shared out once, not twice."""

    def __init__(self, workers: int | None = None):
        self.workers = checked_count(workers, processes_that_fit)
        # forking a process that has threads, as JAX's has, can hang
        spawn = multiprocessing.get_context("spawn")
        super().__init__(self.workers, mp_context=spawn, initializer=_begin_process)

    def __exit__(self, kind, error, trace):
        """Wait for what is being done and leave the rest; a process that was killed has taken the others with it.

        Raises:
            S2C2AError: one was.
        """
        self.shutdown(cancel_futures=True)
        if isinstance(error, BrokenProcessPool):
            raise S2C2AError(
                f"one of {self.workers} processes was killed, perhaps for want of memory; what was whole is kept: say "
                "the same again to go on, with fewer --jobs if it happens again"
            ) from error


def _begin_process() -> None:
    # an interrupt from the keyboard ends it without a word
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compute_on_one_thread()


def _end_with_parent() -> None:
    """A process that waits for work would outlive one that was killed, for ever."""
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)


def checked_count(count: int | None, otherwise: Callable[[], int]) -> int:
    """How many side by side.

    Raises:
        S2C2AError: fewer than one.
    """
    if count is not None and count < 1:
        raise S2C2AError(
            f"{count} side by side asked for; take at least one, or leave it out for all cores"
        )
    return otherwise() if count is None else count


def max_begun(executor: Executor) -> int:
    """How many calls may be begun and not yet handed over, now; in this process none before the last is handed over."""
    return (
        1
        if isinstance(executor, Serial)
        else BEGUN_EACH * getattr(executor, "workers", WORKERS_UNSAID)
    )


def in_order(
    executor: Executor, work: Callable[[Given], Result], given: Iterable[Given]
) -> Iterator[Result]:
    """Results in the order of what they are made from; a failure or interrupt cancels what has not begun.

    Raises:
        Exception: whatever the work raises.
    """
    begun: deque[Future[Result]] = deque()
    try:
        for one in given:
            begun.append(executor.submit(work, one))
            while len(begun) >= max_begun(executor):
                yield begun.popleft().result()
        while begun:
            yield begun.popleft().result()
    finally:
        cancel(begun)


def cancel(futures: Iterable[Future]) -> None:
    """Give up what has not begun."""
    for future in futures:
        future.cancel()
