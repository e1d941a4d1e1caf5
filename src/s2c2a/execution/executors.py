"""Executors for parallel work: this process, threads, or processes on all cores.

They follow `concurrent.futures.Executor`; the executor of dask fits too. A task is a
function and its argument, with the random seed in the argument. Its result therefore
does not depend on the executor or on the order, and a lost task can be repeated.
"""

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from s2c2a.errors import S2C2AError
from s2c2a.execution.child import spawning
from s2c2a.plugins.discovery import run_with_trust, trusted_code

Given = TypeVar("Given")
Result = TypeVar("Result")

PENDING_PER_WORKER = 2
"""Pending calls per worker: no worker idles, and few results wait in memory."""
DEFAULT_WORKERS = 32
"""Assumed number of workers of an executor without an attribute `workers`."""
MEMORY_PER_PROCESS = 1.5e9
"""Memory of a process that trains networks or runs a strategy [bytes], with a margin
(docs/guides/cluster.md)."""


def all_cores() -> int:
    """Number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def default_process_count() -> int:
    """Number of worker processes: one per core, limited by memory except on Windows."""
    if not hasattr(os, "sysconf"):  # Windows, where a pool has at most 61 processes
        return min(all_cores(), 61)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return max(1, min(all_cores(), int(memory / MEMORY_PER_PROCESS)))


def limit_jax_to_one_thread() -> None:
    """Limit JAX on the CPU to one thread; call it before the first computation.

    The order in which XLA adds numbers depends on its number of threads, and so does
    the last bit of a trained weight. With one thread, a seed gives the same networks on
    any number of cores. The networks are so small that more threads gain nothing.
    """
    # older versions of XLA read NPROC
    os.environ.update(PJRT_NPROC="1", NPROC="1")


class Serial(Executor):
    """Executor in this process: `submit` runs the call. Interrupts pass through."""

    def submit(self, fn: Callable[..., Result], /, *args, **kwargs) -> Future[Result]:
        """Run the call now and return its finished future."""
        future: Future[Result] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Threads(ThreadPoolExecutor):
    """Threads of this process, one per core by default.

    They suit work that releases Python's lock, such as the physics of MuJoCo.
    """

    def __init__(self, workers: int | None = None):
        self.workers = validated_worker_count(workers, all_cores)
        super().__init__(self.workers)


class Processes(ProcessPoolExecutor):
    """Processes of this machine with one JAX thread each."""

    def __init__(self, workers: int | None = None):
        self.workers = validated_worker_count(workers, default_process_count)
        super().__init__(
            self.workers, mp_context=spawning(), initializer=_start_process
        )

    def __exit__(self, kind, error, trace):
        """Wait for running calls and cancel the others.

        Raises:
            S2C2AError: the system killed a worker, which breaks the whole pool.
        """
        self.shutdown(cancel_futures=True)
        if isinstance(error, BrokenProcessPool):
            raise S2C2AError(
                f"one of {self.workers} processes was killed, perhaps because memory "
                "ran out; finished work is kept. Repeat the command to continue, with "
                "fewer --jobs if it happens again"
            ) from error


def _start_process() -> None:
    # a keyboard interrupt ends the worker without a traceback
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    limit_jax_to_one_thread()


def _exit_with_parent() -> None:
    """End this process with its parent; an idle worker would otherwise never end."""
    if parent := multiprocessing.parent_process():
        parent.join()
        os._exit(1)


def validated_worker_count(count: int | None, otherwise: Callable[[], int]) -> int:
    """Number of workers: `count`, or the result of `otherwise` if that is None.

    Raises:
        S2C2AError: `count` is less than one.
    """
    if count is None:
        return otherwise()
    if count < 1:
        raise S2C2AError(
            f"{count} workers were given; give at least one, or leave the number out "
            "for all cores"
        )
    return count


def max_pending_calls(executor: Executor) -> int:
    """Maximum number of pending calls: one in this process, otherwise two a worker."""
    if isinstance(executor, Serial):
        return 1
    return PENDING_PER_WORKER * getattr(executor, "workers", DEFAULT_WORKERS)


def submit(
    executor: Executor, function: Callable[..., Result], *args: Any
) -> Future[Result]:
    """Submit a call to a worker that trusts the same custom code as this process."""
    return executor.submit(run_with_trust, trusted_code(), function, *args)


def in_order(
    executor: Executor, work: Callable[[Given], Result], arguments: Iterable[Given]
) -> Iterator[Result]:
    """Yield results in the order of their arguments.

    A failure or an interrupt cancels all calls that have not started.

    Raises:
        Exception: any exception of `work`.
    """
    pending: deque[Future[Result]] = deque()
    try:
        for argument in arguments:
            pending.append(submit(executor, work, argument))
            while len(pending) >= max_pending_calls(executor):
                yield pending.popleft().result()
        while pending:
            yield pending.popleft().result()
    finally:
        cancel(pending)


def cancel(futures: Iterable[Future]) -> None:
    """Cancel all calls that have not started."""
    for future in futures:
        future.cancel()
