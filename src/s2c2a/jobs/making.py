"""Making what is missing: recordings once, then networks, then runs, over any executor of the standard kind.

An executor other than `Serial` needs no common disk: an artifact is made in an empty folder with copies of what it
needs, comes back as bytes, and is kept here. What is kept on one machine is what travels, so there is no second path
that could differ.
"""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from graphlib import TopologicalSorter
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

from s2c2a.errors import ClusterError, S2C2AError
from s2c2a.executors import Given, Result, Serial, cancel, compute_on_one_thread, most_begun
from s2c2a.files import save_whole
from s2c2a.jobs.artifacts import Artifact, Cache, Made
from s2c2a.jobs.job import Job, Run
from s2c2a.progress import Progress, quiet


def run_all(
    jobs: Sequence[Job], cache: Cache, executor: Executor | None = None, progress: Progress = quiet
) -> list[Run]:
    """Runs of all jobs, found or made; same seeds, same scores, on any executor and after any kill.

    Args:
        jobs: what to run.
        cache: where recordings, networks and runs are kept.
        executor: who works; this process if None, one thing after the other, told in detail.
        progress: told of it.

    Returns:
        Runs in the order of their jobs.

    Raises:
        S2C2AError: an impossible robot, before anything is trained; or a job failed, after all others were finished.
    """
    check_robots(jobs)
    return make_all(jobs, cache, executor, progress)


def check_robots(jobs: Sequence[Job]) -> None:
    """Raise S2C2AError where a job's robot cannot be."""
    for one in {(id(job.arm), job.conditions): job for job in jobs}.values():
        one.conditions.body.make(one.arm)


def make_all(
    artifacts: Sequence[Artifact[Made]], cache: Cache, executor: Executor | None = None, progress: Progress = quiet
) -> list[Made]:
    """What artifacts hold, found or made, in their order; see `run_all`."""
    made = try_all(artifacts, cache, executor, progress)
    failed = [(one, error) for one, error in zip(artifacts, made, strict=True) if isinstance(error, S2C2AError)]
    if failed:
        one, error = failed[0]
        raise S2C2AError(
            f"{len(failed)} of {len(made)} {one.kind} failed, such as {one}: {error}; what was whole is kept"
        ) from error
    return [one for one in made if not isinstance(one, S2C2AError)]


class Make(Protocol):
    """`make_all`, with cache, executor and progress settled."""

    def __call__(self, artifacts: Sequence[Artifact[Made]], /) -> list[Made]: ...  # noqa: D102 (the class says it)


def in_groups(make: Callable[[list[Given]], list[Result]], groups: Sequence[Sequence[Given]]) -> list[list[Result]]:
    """What the artifacts of several lists hold, made all together, a list for each."""
    every = iter(make([one for group in groups for one in group]))
    return [list(islice(every, len(group))) for group in groups]


def made(artifact: Artifact[Made], cache: Cache, progress: Progress = quiet) -> Made:
    """What one artifact holds, found or made here; see `run_all`."""
    return make_all([artifact], cache, progress=progress)[0]


def try_all(
    artifacts: Sequence[Artifact[Made]], cache: Cache, executor: Executor | None = None, progress: Progress = quiet
) -> list[Made | S2C2AError]:
    """The same, with the error in the place of what failed."""
    making = _Making(_missing(artifacts, cache), cache, executor or Serial(), progress)
    failed = making.finish()
    return [failed.get(one.path(cache)) or one.load(cache) for one in artifacts]


def _missing(artifacts: Sequence[Artifact], cache: Cache) -> dict[Path, Artifact]:
    """What is not there, and what is not there of what it is made from, by where it is kept."""
    there: dict[Path, bool] = {}
    missing: dict[Path, Artifact] = {}
    left = deque(artifacts)
    while left:
        one = left.popleft()
        path = one.path(cache)
        if path not in there:
            there[path] = one.is_in(cache)
            if not there[path]:
                missing[path] = one
                left.extend(one.needs)
    return missing


class _Making:
    """Artifacts on their way, each begun when what it needs is there."""

    def __init__(self, missing: dict[Path, Artifact], cache: Cache, executor: Executor, progress: Progress):
        self._missing, self._cache, self._executor, self._progress = missing, cache, executor, progress
        needs = {path: [need.path(cache) for need in one.needs] for path, one in missing.items()}
        self._needs = {path: [need for need in every if need in missing] for path, every in needs.items()}
        self._order = TopologicalSorter(self._needs)
        self._begun: dict[Future[bytes | None], Path] = {}
        self._failed: dict[Path, S2C2AError] = {}
        self._totals = Counter(one.kind for one in missing.values())
        self._done: Counter[str] = Counter()

    def finish(self) -> dict[Path, S2C2AError]:
        """Make all; returns why those failed that did."""
        self._order.prepare()
        for kind, total in reversed(self._totals.items()):
            self._progress(f"making {kind}", 0, total)
        ready: deque[Path] = deque()
        try:
            while self._order.is_active():
                ready.extend(self._order.get_ready())
                while ready and len(self._begun) < most_begun(self._executor):
                    self._begin(ready.popleft())
                for future in wait(self._begun, return_when=FIRST_COMPLETED).done:
                    self._end(future)
        finally:
            cancel(self._begun)
        return self._failed

    def _begin(self, path: Path) -> None:
        one = self._missing[path]
        if why := next((self._failed[need] for need in self._needs[path] if need in self._failed), None):
            self._failed[path] = why
            self._told(path)
        elif isinstance(self._executor, Serial):  # it has this disk, and can tell in detail
            self._begun[self._executor.submit(one.make, self._cache, self._progress)] = path
        else:
            needed = [need.path(self._cache).read_bytes() for need in one.needs]
            self._begun[self._executor.submit(_made_elsewhere, one, needed)] = path

    def _end(self, future: Future[bytes | None]) -> None:
        path = self._begun.pop(future)
        try:
            content = future.result()
        except ClusterError:  # of the executor, not of what was made
            raise
        except S2C2AError as error:
            self._failed[path] = error
        else:
            if content is not None:
                save_whole(content, path)
        self._told(path)

    def _told(self, path: Path) -> None:
        kind = self._missing[path].kind
        self._order.done(path)
        self._done[kind] += 1
        self._progress(f"making {kind}", self._done[kind], self._totals[kind])


def _made_elsewhere(one: Artifact, needed: list[bytes]) -> bytes:
    """On the executor's side: the artifact, made where there is nothing but what it needs."""
    compute_on_one_thread()
    with TemporaryDirectory() as place:
        cache = Cache(Path(place), threads=1)
        for need, content in zip(one.needs, needed, strict=True):
            save_whole(content, need.path(cache))
        one.make(cache, quiet)
        return one.path(cache).read_bytes()
