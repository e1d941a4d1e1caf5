"""Work cut into shards, and whoever does them: this process, threads, all cores, or the machines of a cluster.

A shard is a function and what it is given. It depends on nothing else (its seed is part of what it is given), so its
result is the same wherever and in whatever order shards are done, and a shard that is lost is simply done again.
"""

import multiprocessing
import os
import signal
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from s2c2a.errors import S2C2AError

Shard = TypeVar("Shard")
Result = TypeVar("Result")

WAITING = 2
"""Shards begun or waiting for each that can be done at a time: nobody idles, and few results wait in memory."""


MEMORY_EACH = 1.5e9
"""What a process takes that trains networks or drives a strategy [bytes], with some room (docs/cluster.md)."""


def all_cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def processes_that_fit() -> int:
    """One for every core, and no more than memory holds."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(1, min(all_cores(), int(memory / MEMORY_EACH)))


def compute_on_one_thread() -> None:
    """Let JAX's CPU take one thread in this process; it heeds this until its first computation.

    How XLA cuts up a sum depends on how many threads it has, and so does the last bit of a trained weight. With one, a
    seed gives the same networks on any number of cores. These networks are so small that more threads gain nothing.
    """
    os.environ.update(PJRT_NPROC="1", NPROC="1")  # the second is what older versions of XLA read


class Crew(AbstractContextManager["Crew"]):
    """Whoever does shards; a context, left when all is done or nothing more is wanted."""

    @abstractmethod
    def submit(self, work: Callable[..., Result], *given: Any) -> Future[Result]:
        """Have a shard done."""

    @abstractmethod
    def most_begun(self) -> int:
        """How many shards may be begun and not yet handed over, now."""

    def fault(self, error: BaseException) -> S2C2AError | None:
        """What to tell where the crew failed rather than the work; None if it was the work."""
        return None


class Here(Crew):
    """This process: one shard at a time, none begun before the last is handed over."""

    def submit(self, work: Callable[..., Result], *given: Any) -> Future[Result]:
        """Do it at once; what it raises comes out here."""
        done: Future[Result] = Future()
        done.set_result(work(*given))
        return done

    def most_begun(self) -> int:
        """One."""
        return 1

    def __exit__(self, *exception) -> None:
        """Nothing to leave behind."""


class _Pool(Crew):
    """A pool of the standard library."""

    def __init__(self, count: int, pool: Executor):
        self.count = count
        self._pool = pool

    def submit(self, work: Callable[..., Result], *given: Any) -> Future[Result]:
        """See `Crew`."""
        return self._pool.submit(work, *given)

    def most_begun(self) -> int:
        """See `Crew`."""
        return WAITING * self.count

    def __exit__(self, *exception) -> None:
        """Wait for what is being done; what is not begun stays undone."""
        self._pool.shutdown(cancel_futures=True)


class Threads(_Pool):
    """Threads of this process, for work that is not Python's: the physics of MuJoCo."""

    def __init__(self, count: int | None = None):
        count = checked_count(count, all_cores)
        super().__init__(count, ThreadPoolExecutor(count))


class Processes(_Pool):
    """Processes of this machine, one thread each: cores are shared out once, not twice."""

    def __init__(self, count: int | None = None):
        count = checked_count(count, processes_that_fit)
        spawn = multiprocessing.get_context("spawn")  # forking a process that has threads, as JAX's has, can hang
        super().__init__(count, ProcessPoolExecutor(count, mp_context=spawn, initializer=_begin_process))

    def fault(self, error: BaseException) -> S2C2AError | None:
        """A process that was killed takes the pool with it."""
        if not isinstance(error, BrokenProcessPool):
            return None
        return S2C2AError(
            f"one of {self.count} processes was killed, perhaps for want of memory; what was whole is kept: say the "
            "same again to go on, with fewer --jobs if it happens again"
        )


def _begin_process() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # an interrupt from the keyboard ends it without a word
    compute_on_one_thread()


def checked_count(count: int | None, otherwise: Callable[[], int]) -> int:
    """How many side by side.

    Raises:
        S2C2AError: fewer than one.
    """
    if count is not None and count < 1:
        raise S2C2AError(f"{count} side by side asked for; take at least one, or leave it out for all cores")
    return otherwise() if count is None else count


def in_order(crew: Crew, work: Callable[[Shard], Result], shards: Iterable[Shard]) -> Iterator[Result]:
    """Results in the order of their shards; a failure or interrupt cancels what has not begun.

    Raises:
        S2C2AError: the crew failed; else whatever the work raises.
    """
    begun: deque[Future[Result]] = deque()
    try:
        for shard in shards:
            begun.append(crew.submit(work, shard))
            while len(begun) >= crew.most_begun():
                yield _result(crew, begun.popleft())
        while begun:
            yield _result(crew, begun.popleft())
    finally:
        _cancel(begun)


def as_done(crew: Crew, work: Callable[[Shard], Result], shards: Iterable[Shard]) -> Iterator[tuple[Shard, Result]]:
    """Shards and results as they come, for shards of unequal size; otherwise see `in_order`."""
    begun: dict[Future[Result], Shard] = {}

    def handed_over() -> Iterator[tuple[Shard, Result]]:
        done, _ = wait(begun, return_when=FIRST_COMPLETED)
        for future in done:
            yield begun.pop(future), _result(crew, future)

    try:
        for shard in shards:
            begun[crew.submit(work, shard)] = shard
            while len(begun) >= crew.most_begun():
                yield from handed_over()
        while begun:
            yield from handed_over()
    finally:
        _cancel(begun)


def _result(crew: Crew, future: Future[Result]) -> Result:
    try:
        return future.result()
    except BaseException as error:
        if fault := crew.fault(error):
            raise fault from error
        raise


def _cancel(futures: Iterable[Future]) -> None:
    for future in futures:
        future.cancel()
