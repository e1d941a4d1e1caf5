"""Making what is missing: recordings once, then networks, then runs, over any executor of the standard kind.

An executor other than `Serial` needs no common disk: an artifact is made in an empty
folder with copies of what it needs, comes back as bytes, and is kept here. What is kept
on one machine is what travels, so there is no second path that could differ.
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
from s2c2a.executors import (
    Given,
    Result,
    Serial,
    cancel,
    compute_on_one_thread,
    max_begun,
)
from s2c2a.files import save_whole
from s2c2a.jobs.artifacts import Artifact, Cache, Made
from s2c2a.jobs.job import Job
from s2c2a.progress import Progress, quiet


def make_all(
    artifacts: Sequence[Artifact[Made]],
    cache: Cache,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> list[Made]:
    """What artifacts hold, found or made: runs of jobs, networks, recordings.

    Same seeds, same scores, on any executor and after any kill.

    Args:
        artifacts: what is asked for.
        cache: where recordings, networks and runs are kept.
        executor: who works; this process if None, one thing after the other, told in
            detail.
        progress: told of it.

    Returns:
        What they hold, in their order.

    Raises:
        S2C2AError: an impossible robot, before anything is trained; or something
            failed, after all else was finished.
    """
    check_robots([one for one in artifacts if isinstance(one, Job)])
    made = try_all(artifacts, cache, executor, progress)
    failed = [
        (one, error)
        for one, error in zip(artifacts, made, strict=True)
        if isinstance(error, S2C2AError)
    ]
    if failed:
        (one, error) = failed[0]
        count = f"{len(failed)} of {len(made)}"
        raise S2C2AError(
            f"{count} {one.kind} failed, such as {one}: {error}; what was whole is kept"
        ) from error
    return [one for one in made if not isinstance(one, S2C2AError)]


run_all = make_all
"""For jobs, whose runs it returns."""


def check_robots(jobs: Sequence[Job]) -> None:
    """Raise S2C2AError where a job's robot cannot be."""
    for one in {(id(job.arm), job.conditions): job for job in jobs}.values():
        one.robot()


Make = Callable[[Sequence[Artifact[Any]]], list[Any]]
"""`make_all`, with cache, executor and progress settled."""


def in_groups(
    make: Callable[[list[Given]], list[Result]], groups: Sequence[Sequence[Given]]
) -> list[list[Result]]:
    """What the artifacts of several lists hold, made all together, a list for each."""
    every = iter(make([one for group in groups for one in group]))
    return [list(islice(every, len(group))) for group in groups]


def made(artifact: Artifact[Made], cache: Cache, progress: Progress = quiet) -> Made:
    """What one artifact holds, found or made here; see `make_all`."""
    return make_all([artifact], cache, progress=progress)[0]


def try_all(
    artifacts: Sequence[Artifact[Made]],
    cache: Cache,
    executor: Executor | None = None,
    progress: Progress = quiet,
) -> list[Made | S2C2AError]:
    """The same, with the error in the place of what failed."""
    failed = _Making(
        _missing(artifacts, cache), cache, executor or Serial(), progress
    ).finish()
    return [failed.get(one.path(cache)) or one.load(cache) for one in artifacts]


def _missing(artifacts: Sequence[Artifact], cache: Cache) -> dict[Path, Artifact]:
    """What is not there, and what is not there of what it is made from, by where it is kept."""
    seen: dict[Path, Artifact | None] = {}
    left = list(artifacts)
    for one in left:  # which grows
        if (path := one.path(cache)) not in seen:
            seen[path] = missing = None if one.is_in(cache) else one
            left.extend(missing.needs if missing else ())
    return {path: one for path, one in seen.items() if one}


class _Making:
    """Artifacts on their way, each begun when what it needs is there."""

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
        self._failed: dict[Path, S2C2AError] = {}
        self._totals = Counter(one.kind for one in missing.values())
        self._done: Counter[str] = Counter()

    def finish(self) -> dict[Path, S2C2AError]:
        """Make all; returns why those failed that did."""
        for kind, total in reversed(self._totals.items()):
            self._progress(f"making {kind}", 0, total)
        needs = {
            path: {need.path(self._cache) for need in one.needs}
            for path, one in self._missing.items()
        }
        order = TopologicalSorter(
            {path: every & self._missing.keys() for path, every in needs.items()}
        )
        ready = deque[Path]()
        begun = dict[Future[bytes | None], Path]()
        order.prepare()
        try:
            while order.is_active():
                ready.extend(order.get_ready())
                while ready and len(begun) < max_begun(self._executor):
                    path = ready.popleft()
                    begun[self._submitted(self._missing[path])] = path
                for future in wait(begun, return_when=FIRST_COMPLETED).done:
                    path = begun.pop(future)
                    self._end(future, path)
                    order.done(path)
        finally:
            cancel(begun)
        return self._failed

    def _submitted(self, one: Artifact) -> Future[bytes | None]:
        needed = [need.path(self._cache) for need in one.needs]
        if lost := [self._failed[path] for path in needed if path in self._failed]:
            return Serial().submit(_failed, lost[0])
        # it has this disk, and can tell in detail
        if isinstance(self._executor, Serial):
            return self._executor.submit(one.make, self._cache, self._progress)
        return self._executor.submit(
            _made_elsewhere, one, [path.read_bytes() for path in needed]
        )

    def _end(self, future: Future[bytes | None], path: Path) -> None:
        try:
            if content := future.result():
                save_whole(content, path)
        except ClusterError:  # of the executor, not of what was made
            raise
        except S2C2AError as error:
            self._failed[path] = error
        kind = self._missing[path].kind
        self._done[kind] += 1
        self._progress(f"making {kind}", self._done[kind], self._totals[kind])


def _failed(why: S2C2AError) -> None:
    raise why


def _made_elsewhere(one: Artifact, needed: list[bytes]) -> bytes:
    """On the executor's side: the artifact, made where there is nothing but what it needs."""
    compute_on_one_thread()
    with TemporaryDirectory() as place:
        cache = Cache(Path(place), threads=1)
        for need, content in zip(one.needs, needed, strict=True):
            save_whole(content, need.path(cache))
        one.make(cache, quiet)
        return one.path(cache).read_bytes()
