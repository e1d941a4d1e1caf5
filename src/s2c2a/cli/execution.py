"""How verbs have things made: by whom, in which folder, on which body, told by a bar."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from s2c2a.cache import cache_folder
from s2c2a.cli.console import progress_bar
from s2c2a.errors import S2C2AError
from s2c2a.executors import Processes, Serial, compute_on_one_thread
from s2c2a.robots.factory import Body, options_from, robot_class

if TYPE_CHECKING:
    from s2c2a import jobs

RobotName = Annotated[str, tyro.conf.arg(metavar="sim|MODULE:CLASS")]
RobotOptions = Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...")]
Address = Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")]


@dataclass(frozen=True)
class _Folder:
    """Where results go.

    Attributes:
        out: the run folder; one under runs/ if not stated.
        overwrite: replace the run folder if it exists.
    """

    out: Path | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class _Work(_Folder):
    """Where results go, and who works; the results are the same.

    Attributes:
        jobs: trainings and runs side by side; all cores if not stated.
        cluster: let the workers of a dask scheduler do it: its address
            (tcp://host:8786, or the file where it wrote it), or local for one on this
            machine; docs/cluster.md.
    """

    jobs: int | None = None
    cluster: Address = None


NEW_FOLDER = _Folder()
ALL_CORES = _Work()
Folder = Annotated[_Folder, tyro.conf.arg(name="")]
Work = Annotated[_Work, tyro.conf.arg(name="")]


def executor_for(jobs: int | None = None, cluster: str | None = None) -> Executor:
    """Processes of this machine, or the workers of a cluster.

    Args:
        jobs: side by side on this machine; all cores if None.
        cluster: its address; none if None.

    Raises:
        S2C2AError: no such cluster, its extra is missing, or a number that belongs to
            another machine.
    """
    if cluster is None:
        return Processes(jobs)
    require("cluster", "distributed")
    from s2c2a.jobs.cluster import LOCAL, Cluster

    if jobs is not None and cluster != LOCAL:
        raise S2C2AError(
            f"{jobs} side by side asked for; how many workers {cluster} has is said where they start"
        )
    return Cluster(cluster, jobs)


@contextmanager
def making(
    label: str,
    options: dict,
    folder: _Folder,
    *,
    alone: bool = False,
    go_on: bool = False,
    own_data: bool = False,
) -> "Iterator[tuple[Path, jobs.Make]]":
    """A run folder, and what finds or makes things in it.

    Args:
        label: of a folder that has no name.
        options: that it is made with.
        folder: where it shall be, and who works if it says so; else this process, which
            tells in detail.
        alone: whether this process works whatever the folder says.
        go_on: whether one that was begun with the same options is gone on with, also
            under runs/.
        own_data: whether recordings and networks stay in it as well, and not in the
            cache.
    """
    from s2c2a import jobs
    from s2c2a.jobs.run_folder import open_run_folder

    compute_on_one_thread()
    with (
        executor_for(folder.jobs, folder.cluster)
        if isinstance(folder, _Work) and not alone
        else Serial() as executor
    ):
        place = open_run_folder(folder.out, label, options, folder.overwrite, go_on)
        kept = jobs.Cache(
            place / "data" if own_data else cache_folder(), place / "runs"
        )

        def make(artifacts):
            with progress_bar() as progress:
                return jobs.make_all(artifacts, kept, executor, progress)

        yield place, make


def require(extra: str, *packages: str) -> None:
    """Say what to install where a package of an extra is missing.

    Raises:
        S2C2AError: one is.
    """
    if missing := [package for package in packages if find_spec(package) is None]:
        raise S2C2AError(
            f'{", ".join(missing)} is missing; say, in your clone of s2c2a: pip install ".[{extra}]"'
        )


def body_for(
    robot: str, options: tuple[str, ...], fidelity: str = "fast", payload: float = 0.0
) -> Body:
    """The body, and how it is made; nothing is opened yet.

    Raises:
        S2C2AError: no such class, no option, or one of the simulation's for another
            body.
    """
    given = options_from(options)
    if Body(robot).simulated:
        return Body(
            robot, (*Body.simulation(fidelity, payload=payload).options, *given)
        )
    if fidelity != "fast" or payload:
        raise S2C2AError(
            f"--fidelity and --payload are of the simulated arm, and --robot is {robot}; leave them out"
        )
    robot_class(robot)  # what is not there is told before anything else
    return Body(robot, given)
