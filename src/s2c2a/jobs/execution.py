"""Making missing artifacts on any executor: recordings first, then networks, then runs.

Executors other than `Serial` need no shared disk: a worker makes an artifact in an
empty directory with copies of what it needs, and sends its file back as bytes. The
cache holds the same bytes, so there is one file format for both.
"""

from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from graphlib import TopologicalSorter
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from s2c2a.errors import ClusterError, S2C2AError
from s2c2a.execution.compilation import forget_programs
from s2c2a.execution.executors import (
    Given,
    Result,
    Serial,
    cancel,
    limit_jax_to_one_thread,
    max_pending_calls,
    submit,
)
from s2c2a.execution.progress import Progress, quiet
from s2c2a.files.text import write_atomically
from s2c2a.jobs.artifacts import Artifact, Cache, Made
from s2c2a.jobs.job import Job


def make_all(
    artifacts: Sequence[Artifact[Made]],
    cache: Cache,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> list[Made]:
    """Load or make artifacts: runs of jobs, networks, recordings.

    The same seeds give the same scores on any executor and after any interruption.

    Args:
        artifacts: to load or make.
        cache: where recordings, networks and runs are kept.
        executor: makes them; this process, one after the other, if None.
        progress: called with a label, the number done and the total.

    Returns:
        Their contents, in the same order.

    Raises:
        S2C2AError: a robot is impossible, before anything is made; or an artifact
            failed, after all others were made.
    """
    check_robots([artifact for artifact in artifacts if isinstance(artifact, Job)])
    results = try_all(artifacts, cache, executor, progress)
    failures = [
        (artifact, result)
        for artifact, result in zip(artifacts, results, strict=True)
        if isinstance(result, S2C2AError)
    ]
    if failures:
        artifact, error = failures[0]
        if len(results) == 1:
            raise S2C2AError(f"{error} ({artifact})") from error
        raise S2C2AError(
            f"{len(failures)} of {len(results)} {artifact.kind} failed, such as "
            f"{artifact}: {error}; finished results are kept"
        ) from error
    return [result for result in results if not isinstance(result, S2C2AError)]


def check_robots(jobs: Sequence[Job]) -> None:
    """Raise S2C2AError for a job whose robot is impossible."""
    distinct = {(id(job.arm), job.conditions): job for job in jobs}
    for job in distinct.values():
        job.robot()


Make = Callable[[Sequence[Artifact[Any]]], list[Any]]
"""`make_all` with a fixed cache, executor and progress."""


def in_groups(
    make: Callable[[list[Given]], list[Result]], groups: Sequence[Sequence[Given]]
) -> list[list[Result]]:
    """Make the artifacts of several lists together, and return a list for each."""
    results = iter(make([artifact for group in groups for artifact in group]))
    return [list(islice(results, len(group))) for group in groups]


def made(artifact: Artifact[Made], cache: Cache, progress: Progress = quiet) -> Made:
    """Load one artifact, or make it in this process; see `make_all`."""
    return make_all([artifact], cache, progress=progress)[0]


def try_all(
    artifacts: Sequence[Artifact[Made]],
    cache: Cache,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> list[Made | S2C2AError]:
    """Like `make_all`, with the error in the place of each artifact that failed."""
    missing = _missing(artifacts, cache)
    failures = _Batch(missing, cache, executor or Serial(), progress).make()
    return [
        failures.get(artifact.path(cache)) or artifact.load(cache)
        for artifact in artifacts
    ]


def _missing(artifacts: Sequence[Artifact], cache: Cache) -> dict[Path, Artifact]:
    """Missing artifacts, and the missing ones that these need, by path."""
    missing: dict[Path, Artifact] = {}
    queue = deque(artifacts)
    while queue:
        artifact = queue.popleft()
        path = artifact.path(cache)
        if path not in missing and not artifact.is_in(cache):
            missing[path] = artifact
            queue.extend(artifact.needs)
    return missing


class _Batch:
    """Artifacts to make, each after the artifacts that it needs."""

    def __init__(
        self,
        missing: dict[Path, Artifact],
        cache: Cache,
        executor: Executor,
        progress: Progress,
    ):
        self._missing = missing
        self._cache = cache
        self._executor = executor
        self._progress = progress
        self._failures: dict[Path, S2C2AError] = {}
        self._totals = Counter(artifact.kind for artifact in missing.values())
        self._done: Counter[str] = Counter()

    def make(self) -> dict[Path, S2C2AError]:
        """Make all artifacts and return the errors of those that failed."""
        for kind in reversed(self._totals):
            self._report(kind)
        order = TopologicalSorter[Path]()
        for path, artifact in self._missing.items():
            needs = {need.path(self._cache) for need in artifact.needs}
            order.add(path, *(needs & self._missing.keys()))
        ready = deque[Path]()
        running = dict[Future[bytes | None], Path]()
        order.prepare()
        try:
            while order.is_active():
                ready.extend(order.get_ready())
                while ready and len(running) < max_pending_calls(self._executor):
                    path = ready.popleft()
                    running[self._submit(self._missing[path])] = path
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    path = running.pop(future)
                    self._finish(future, path)
                    order.done(path)
        finally:
            cancel(running)
        return self._failures

    def _submit(self, artifact: Artifact) -> Future[bytes | None]:
        needs = [need.path(self._cache) for need in artifact.needs]
        for path in needs:
            if path in self._failures:
                return Serial().submit(_fail, self._failures[path])
        # this process has the cache, and can report details
        if isinstance(self._executor, Serial):
            return self._executor.submit(artifact.make, self._cache, self._progress)
        contents = [path.read_bytes() for path in needs]
        return submit(self._executor, _make_on_worker, artifact, contents)

    def _finish(self, future: Future[bytes | None], path: Path) -> None:
        try:
            content = future.result()
            if content:
                write_atomically(content, path)
        except ClusterError:  # a failure of the executor, not of the artifact
            raise
        except S2C2AError as error:
            self._failures[path] = error
        kind = self._missing[path].kind
        self._done[kind] += 1
        self._report(kind)

    def _report(self, kind: str) -> None:
        self._progress(f"making {kind}", self._done[kind], self._totals[kind])


def _fail(error: S2C2AError) -> None:
    raise error


def _make_on_worker(artifact: Artifact, contents: list[bytes]) -> bytes:
    """Make an artifact in a directory that holds only the files that it needs."""
    limit_jax_to_one_thread()
    with TemporaryDirectory() as folder:
        cache = Cache(Path(folder), threads=1)
        for need, content in zip(artifact.needs, contents, strict=True):
            write_atomically(content, need.path(cache))
        artifact.make(cache, quiet)
        forget_programs()
        return artifact.path(cache).read_bytes()
