"""How verbs have things made: who works, in which folder, told by a bar."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.cli.console import progress_bar
from s2c2a.errors import S2C2AError

if TYPE_CHECKING:
    from s2c2a.jobs import Make

Address = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="ADDRESS",
        help="let the workers of a dask scheduler do it: its address (tcp://host:8786, or the file where it wrote it), "
        "or local for one on this machine; docs/cluster.md",
    ),
]


@dataclass(frozen=True)
class _Workers:
    """Who works; the results are the same.

    Attributes:
        jobs: trainings and runs side by side; all cores if not stated.
        cluster: see docs/cluster.md.
    """

    jobs: int | None = None
    cluster: Address = None


@dataclass(frozen=True)
class _Folder:
    """Where results go.

    Attributes:
        out: the run folder; one under runs/ if not stated.
        overwrite: replace the run folder if it exists.
    """

    out: Path | None = None
    overwrite: bool = False


ALL_CORES, NEW_FOLDER = _Workers(), _Folder()
Workers = Annotated[_Workers, tyro.conf.arg(name="")]
Folder = Annotated[_Folder, tyro.conf.arg(name="")]


def executor_for(jobs: int | None = None, cluster: str | None = None) -> Executor:
    """Processes of this machine, or the workers of a cluster.

    Args:
        jobs: side by side on this machine; all cores if None.
        cluster: its address; none if None.

    Raises:
        S2C2AError: no such cluster, its extra is missing, or a number that belongs to another machine.
    """
    from s2c2a.executors import Processes

    if cluster is None:
        return Processes(jobs)
    require("cluster", "distributed")
    from s2c2a.jobs.cluster import LOCAL, Cluster

    if jobs is not None and cluster != LOCAL:
        raise S2C2AError(f"{jobs} side by side asked for; how many workers {cluster} has is said where they start")
    return Cluster(cluster, jobs)


@contextmanager
def making(
    label: str,
    options: dict,
    folder: _Folder,
    workers: _Workers | None = None,
    *,
    go_on: bool = False,
    own_data: bool = False,
) -> Iterator[tuple[Path, "Make"]]:
    """A run folder, and what finds or makes things in it.

    Args:
        label: of a folder that has no name.
        options: that it is made with.
        folder: where it shall be.
        workers: who works; this process alone if None, which tells in detail.
        go_on: whether one that was begun with the same options is gone on with.
        own_data: whether recordings and networks stay in it as well, and not in the cache.
    """
    from s2c2a.cache import cache_folder
    from s2c2a.executors import Serial, compute_on_one_thread
    from s2c2a.jobs import Cache, make_all
    from s2c2a.jobs.run_folder import open_run_folder

    compute_on_one_thread()
    with executor_for(workers.jobs, workers.cluster) if workers else Serial() as executor:
        place = open_run_folder(folder.out, label, options, folder.overwrite, go_on)
        cache = Cache(place / "data" if own_data else cache_folder(), place / "runs")

        def make(artifacts):
            with progress_bar() as progress:
                return make_all(artifacts, cache, executor, progress)

        yield place, make


def require(extra: str, *packages: str) -> None:
    """Say what to install where a package of an extra is missing.

    Raises:
        S2C2AError: one is.
    """
    if missing := [package for package in packages if find_spec(package) is None]:
        raise S2C2AError(
            f'{", ".join(missing)} is missing; install it, in your clone of s2c2a, with: pip install ".[{extra}]"'
        )
